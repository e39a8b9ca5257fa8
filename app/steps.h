#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/image_files.h"
#include "app/job.h"
#include "app/session.h"
#include "app/surface_task.h"
#include "app/verb.h"
#include "base/aicon_network.h"
#include "base/observation.h"
#include "base/point_list.h"
#include "base/result.h"
#include "base/verdict.h"
#include "markers/detect.h"
#include "markers/family.h"

namespace crosstie::app {

/// What a step did.
struct StepOutcome {
  std::filesystem::path folder;
  std::string summary;   ///< one line for people
  bool current = false;  ///< nothing had changed since the last time: nothing was computed
  Outcome outcome = Outcome::kOk;
};

/// What the detection works on.
struct DetectionTask {
  std::vector<ImageFile> images;               ///< sorted by name
  std::map<std::string, double> white_levels;  ///< by camera, where not the file format's
  markers::MarkerFamily family;
  markers::DetectOptions options;
  std::filesystem::path base_folder;  ///< paths in the result are relative to it
  std::string title;
};

/// The markers that a job uses and how they are looked for.
struct MarkerChoice {
  markers::MarkerFamily family;
  markers::DetectOptions options;
};
base::Result<MarkerChoice> marker_choice(const Job& job);

/// The ids of a family that `texts` name ("0-127"), as the option --ids gives them; kUsage where it has none of them.
base::Result<std::vector<int>> ids_in_use(const std::vector<std::string>& texts, const markers::MarkerFamily& family);

/// The detection that a job asks for.
base::Result<DetectionTask> detection_task(const Job& job);

/// The detection of the cross in the photographs of the job's stations; the image of a station is called station_image().
base::Result<DetectionTask> station_detection_task(const Job& job);
/// The same in one photograph of each camera, called by the camera's name.
base::Result<DetectionTask> pair_detection_task(const Job& job,
                                                const std::vector<std::pair<std::string, std::filesystem::path>>& pair);
/// "x0850/left".
std::string station_image(const std::string& station, const std::string& camera);

/// images -> observations. Images that have not changed since the result in `out` was written are not looked at again.
base::Result<StepOutcome> detect_step(const DetectionTask& task, const std::filesystem::path& out, bool timings,
                                      Session& session);

/// kNoUniqueSolution where the job names nothing that gives the network its scale: to be asked before the photographs are
/// looked at.
base::Result<> check_scale(const Job& job);

/// observations in `detection` -> network coordinates.
base::Result<StepOutcome> adjust_step(const Job& job, const std::filesystem::path& detection, const std::filesystem::path& out,
                                      Session& session);

/// An AICON project to be adjusted as it is.
struct AiconTask {
  std::filesystem::path folder;
  base::AiconNetworkOptions reading;
  std::optional<std::filesystem::path> sigmas;    ///< file of image points with a sigma of their own
  std::optional<std::filesystem::path> excluded;  ///< file of image points that do not take part
  std::vector<std::string> held = {"A3", "C1", "C2"};
  bool reject_outliers = false;
  bool apply_components = false;  ///< sigmas of each group of observations by their residuals
};

/// an AICON project -> network coordinates in the datum of its object points.
base::Result<StepOutcome> adjust_aicon_step(const AiconTask& task, const std::filesystem::path& out, Session& session);

/// What is compared with what.
struct VerificationTask {
  std::filesystem::path measured = {};   ///< a point list or an adjust result.json; with `reference` empty: no points
  std::filesystem::path reference = {};  ///< a point list
  std::string reference_unit;            ///< empty: the file says
  std::filesystem::path base_folder;
  std::string title;
  std::string fit = "rigid";
  std::vector<std::pair<int, int>> not_tested;  ///< distances that define the scale
  JobLimits limits;
  std::optional<SurfaceTask> surface = std::nullopt;

  [[nodiscard]] bool has_points() const { return !reference.empty(); }
};

/// The verification that a job asks for, of its results of adjust, stitch and edge in `results`. kBadInput where there is nothing to verify.
base::Result<VerificationTask> verification_task(const Job& job, const std::filesystem::path& results);

/// coordinates and reference -> deviations.
base::Result<StepOutcome> verify_step(const VerificationTask& task, const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
