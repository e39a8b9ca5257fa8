// The scans of a job's stations.

#include "app/job_scan.h"

#include <fmt/core.h>

#include "app/commission_input.h"
#include "app/steps.h"
#include "app/steps_calibrate.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

tl::unexpected<base::Error> bad_job(const Job& job, const std::string& message) {
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", job.file.string(), message));
}

Result<std::optional<ScanMarkers>> markers_of(const Job& job) {
  if (job.family.empty()) return std::nullopt;
  auto detection = marker_choice(job);
  if (!detection) return tl::unexpected(detection.error());
  return ScanMarkers{std::move(detection->family), std::move(detection->options), job.marker_thickness_mm, job.dot_diameter_mm};
}

}  // namespace

Result<std::vector<StationScan>> station_scans(const Job& job, const std::string& head,
                                               const std::optional<std::string>& station, const fs::path& out) {
  const auto markers = markers_of(job);
  if (!markers) return tl::unexpected(markers.error());
  std::vector<StationScan> scans;
  bool known = !station;
  for (const JobStation& one : job.stations) {
    if (station && one.name != *station) continue;
    known = true;
    if (!one.scan) continue;
    ScanTask task;
    task.head = head;
    task.left = job.resolve(one.scan->left);
    task.right = job.resolve(one.scan->right);
    task.manifest = job.resolve(one.scan->manifest);
    task.markers = *markers;
    const auto [left, right] = head_cameras(job);
    for (const auto& [camera, level] : {std::pair{left, &task.white_levels[0]}, std::pair{right, &task.white_levels[1]}}) {
      if (const auto found = job.cameras.find(camera); found != job.cameras.end()) *level = found->second.white_level;
    }
    task.max_off_curve_px = job.limits.epipolar_px;
    task.station = one.name;
    task.base_folder = job.folder;
    task.title = job.name.empty() ? one.name : fmt::format("{}, {}", job.name, one.name);
    scans.push_back({one.name, std::move(task), out / one.name});
  }
  if (!known) {
    return base::fail(ErrorCode::kUsage, fmt::format("{}: there is no station '{}'", job.file.string(), *station));
  }
  if (scans.empty()) {
    return bad_job(job, station ? fmt::format("the station {} has no scan = {{ left, right, manifest }}", *station)
                                : "no [[station]] has a scan = { left, right, manifest }");
  }
  return scans;
}

Result<fs::path> scan_head_folder(const Job& job, const fs::path& results) {
  std::error_code ignored;
  if (fs::exists(results / "commission" / "result.json", ignored)) return results / "commission";
  return calibration_folder(job, results / "calibrate");
}

Result<fs::path> scan_head(const Job& job, const fs::path& results, Session& session) {
  auto folder = scan_head_folder(job, results);
  if (!folder || *folder != results / "calibrate" || !is_calibrated_here(job)) return folder;
  const auto task = calibration_task(job);
  if (!task) return tl::unexpected(task.error());
  const auto step = calibrate_step(*task, results / "calibrate", session);
  if (!step) return tl::unexpected(step.error());
  session.say("calibrate  " + step->summary);
  return folder;
}

Result<Outcome> scan_stations(const std::vector<StationScan>& scans, const TellScan& tell, Session& session) {
  Outcome outcome = Outcome::kOk;
  for (const StationScan& scan : scans) {
    const auto step = scan_step(scan.task, scan.out, session);
    if (!step) return base::fail(step.error().code, fmt::format("station {}: {}", scan.station, step.error().message));
    tell("scan " + scan.station, *step);
    if (step->outcome == Outcome::kVerdictFailed) outcome = Outcome::kVerdictFailed;
  }
  return outcome;
}

}  // namespace crosstie::app
