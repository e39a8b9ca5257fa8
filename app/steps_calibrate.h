#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/image_files.h"
#include "app/job.h"
#include "app/session.h"
#include "app/steps.h"
#include "base/calibration.h"
#include "base/result.h"
#include "calib/calibrate.h"

namespace crosstie::app {

/// What a calibration works on.
struct CalibrationTask {
  JobBoard board;
  std::vector<std::string> cameras;              ///< one, or left and right
  std::vector<ImageFile> images;                 ///< photographs of the board, sorted by name; none where there are
  std::optional<std::filesystem::path> corners;  ///< corners that another program found, a .vnl file, with
  std::vector<std::pair<std::string, std::string>> corner_patterns;  ///< camera and pattern of its images' names, and
  int width_px = 0;                                                  ///< the size of all of them
  int height_px = 0;
  calib::CalibrateOptions options;
  std::map<std::string, double> temperatures_c;  ///< of the cameras
  std::optional<std::chrono::year_month_day> date;
  std::optional<double> distance_mm;  ///< for which uncertainties are stated; none: the median distance of the boards
  std::optional<std::filesystem::path> previous;  ///< folder of an earlier result, to be compared with
  JobLimits limits;
  std::filesystem::path base_folder;  ///< paths in the result are relative to it
  std::string title;
};

/// The calibration that a job asks for.
base::Result<CalibrationTask> calibration_task(const Job& job);

/// images of a board -> lenses and rig.
base::Result<StepOutcome> calibrate_step(const CalibrationTask& task, const std::filesystem::path& out, Session& session);

/// The corners of a board in images, as one detector found them.
struct FoundCorners {
  std::string detector;  ///< "classic", "sb", "tags", "circles", or the name of the file that they come from
  std::vector<base::BoardImage> images;
  bool sample = false;  ///< only some of the photographs were searched, to compare detectors on them

  [[nodiscard]] int images_with_board() const;
};

/// The one whose corners are to be used comes first: the first one, whose corners are fitted to the pixels and are several times as good, unless
/// another found the board in more than a third more images.
void put_best_first(std::vector<FoundCorners>& found);

/// By all detectors that the task asks for, the one whose corners are used first.
base::Result<std::vector<FoundCorners>> find_board(const CalibrationTask& task, Session& session);

}  // namespace crosstie::app
