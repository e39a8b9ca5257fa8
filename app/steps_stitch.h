#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/steps.h"
#include "registration/merge.h"
#include "registration/stitch.h"

namespace crosstie::app {

/// All that brings the stations' scans into one frame.
struct StitchTask {
  struct Station {
    std::string name;
    std::optional<double> axis_mm;
    std::filesystem::path scan;  ///< folder of its scan's result
  };
  std::vector<Station> stations;
  std::optional<std::filesystem::path> commission;   ///< folder of its result
  std::optional<std::filesystem::path> calibration;  ///< of calibrate, where nothing is commissioned: the head's covariance
  std::optional<std::filesystem::path> reference;    ///< coordinates of the markers round the hole
  std::string reference_unit;
  bool reference_in_part = false;  ///< in a frame of its own, and not the machine's
  registration::SurfaceOptions surface;
  registration::StitchOptions stitch;
  registration::MergeOptions merge;
  JobLimits limits;
  std::filesystem::path base_folder;
  std::string title;
};

/// What the job asks for; its stations' scans and the commissioning are in `results`. kBadInput where no station has a scan.
base::Result<StitchTask> stitch_task(const Job& job, const std::filesystem::path& results);

/// clouds, markers, axis -> one cloud in the machine's frame.
base::Result<StepOutcome> stitch_step(const StitchTask& task, const std::filesystem::path& out, Session& session);

/// Clouds of one part that its surface alone puts together.
struct SurfaceStitchTask {
  std::vector<std::filesystem::path> clouds;  ///< the first one's frame is that of the result; the others lie about right in it
  registration::SurfaceOptions surface;
  registration::StitchOptions stitch;
  registration::MergeOptions merge;
  std::string title;
};

/// clouds -> one cloud; refuses parts whose surface leaves a direction free.
base::Result<StepOutcome> surface_stitch_step(const SurfaceStitchTask& task, const std::filesystem::path& out,
                                              Session& session);

}  // namespace crosstie::app
