#include "app/commission_run.h"

#include "app/steps_calibrate.h"

namespace crosstie::app {

using base::Result;

Result<CommissionSources> commission_sources(const Job& job, const std::filesystem::path& results, const TellStep& tell,
                                             Session& session) {
  const CommissionSources sources{results / "calibrate", results / "adjust", results / "detect-stations"};
  if (is_calibrated_here(job)) {
    const auto task = calibration_task(job);
    if (!task) return tl::unexpected(task.error());
    const auto calibration = calibrate_step(*task, sources.calibration, session);
    if (!calibration) return tl::unexpected(calibration.error());
    tell("calibrate", *calibration);
  }
  if (!job.cross->points) {
    if (const auto scale = check_scale(job); !scale) return tl::unexpected(scale.error());
    const auto task = detection_task(job);
    if (!task) return tl::unexpected(task.error());
    const auto detection = detect_step(*task, results / "detect", false, session);
    if (!detection) return tl::unexpected(detection.error());
    tell("detect", *detection);
    const auto adjustment = adjust_step(job, detection->folder, sources.adjustment, session);
    if (!adjustment) return tl::unexpected(adjustment.error());
    tell("adjust", *adjustment);
  }
  const auto task = station_detection_task(job);
  if (!task) return tl::unexpected(task.error());
  const auto detection = detect_step(*task, sources.detection, false, session);
  if (!detection) return tl::unexpected(detection.error());
  tell("stations", *detection);
  return sources;
}

}  // namespace crosstie::app
