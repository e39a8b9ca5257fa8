// clouds, markers, axis -> one cloud in the machine's frame

#include "app/steps_stitch.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/head_files.h"
#include "app/result_folder.h"
#include "base/commissioning_reader.h"
#include "base/npy.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/scan_markers_reader.h"
#include "base/stitching_document.h"
#include "report/stitching_report.h"
#include "report/stitching_tables.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;
using nlohmann::ordered_json;

constexpr double kReachOfSize = 0.05;  // of surfaces alone: how far off they may lie to begin with

ordered_json options_json(const registration::SurfaceOptions& surface, const registration::StitchOptions& stitch,
                          const registration::MergeOptions& merge) {
  ordered_json json = {{"piece_mm", surface.cell_mm},
                       {"points_per_piece", surface.points_per_cell},
                       {"max_pieces", surface.max_pieces},
                       {"max_icp_rounds", stitch.max_iterations},
                       {"converged_mm", stitch.converged_mm},
                       {"max_normal_rad", stitch.max_normal_rad},
                       {"least_matches", stitch.least_matches},
                       {"least_seen", stitch.least_seen},
                       {"rejection_significance", stitch.rejection_significance},
                       {"marker_tolerance_mm", stitch.marker_tolerance_mm},
                       {"merged_cell_mm", merge.cell_mm}};
  if (stitch.start_reach_mm) json["start_reach_mm"] = *stitch.start_reach_mm;
  if (surface.sigma_mm) json["sigma_mm"] = *surface.sigma_mm;
  return json;
}

ordered_json effective_options(const StitchTask& task) {
  ordered_json json = options_json(task.surface, task.stitch, task.merge);
  json["reference_in_part"] = task.reference_in_part;
  json["limits"] = {{"seam_mm", task.limits.seam_mm},
                    {"calibration_change", task.limits.calibration_change},
                    {"off_axis_w", task.limits.off_axis_w}};
  json["stations"] = ordered_json::array();
  for (const StitchTask::Station& station : task.stations) {
    json["stations"].push_back(
        {{"name", station.name}, {"axis_mm", station.axis_mm ? ordered_json(*station.axis_mm) : ordered_json(nullptr)}});
  }
  return json;
}

std::vector<fs::path> files_of(const StitchTask& task) {
  std::vector<fs::path> paths;
  for (const StitchTask::Station& station : task.stations) {
    paths.push_back(station.scan / "result.json");
    paths.push_back(station.scan / "cloud.ply");
  }
  const auto result_of = [&](const fs::path& folder) {
    paths.push_back(folder / "result.json");
    paths.push_back(folder / "covariance.npy");
  };
  if (task.commission) {
    result_of(*task.commission);
  } else if (task.calibration) {
    result_of(*task.calibration);
  }
  if (task.reference) paths.push_back(*task.reference);
  return paths;
}

Result<registration::MarkerReference> read_reference(const StitchTask& task) {
  const auto list = base::read_point_list(*task.reference, {.unit = task.reference_unit});
  if (!list) return tl::unexpected(list.error());
  registration::MarkerReference reference;
  reference.own_frame = task.reference_in_part;
  const auto size = 3 * static_cast<Eigen::Index>(list->points.size());
  reference.points.xyz_mm.resize(size);
  reference.points.cov_mm2 = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < list->points.size(); ++i) {
    const base::ReferencePoint& point = list->points[i];
    if (!point.cov_mm2) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}: marker {} has no sigmas; without them nobody knows what the list is worth beside "
                              "the scans; add sigma_x_mm, sigma_y_mm, sigma_z_mm",
                              task.reference->string(), point.id));
    }
    const auto row = 3 * static_cast<Eigen::Index>(i);
    reference.points.ids.push_back(point.id);
    reference.points.xyz_mm.segment<3>(row) = point.xyz_mm;
    reference.points.cov_mm2.block<3, 3>(row, row) = *point.cov_mm2;
  }
  return reference;
}

/// The head in the machine's frame, else the calibrated one; nothing where neither is there, or where nothing is known of its errors.
Result<std::optional<registration::CommissionedHead>> read_commissioned(const StitchTask& task) {
  using Found = std::optional<registration::CommissionedHead>;
  if (task.commission) {
    const auto commissioning = base::read_commissioning(*task.commission);
    if (!commissioning) return tl::unexpected(commissioning.error());
    auto head = registration::CommissionedHead::of(*commissioning);
    if (!head) return fail(head.error().code, fmt::format("{}: {}", task.commission->string(), head.error().message));
    return Found(*std::move(head));
  }
  if (!task.calibration) return Found();
  const auto head = read_head(task.calibration->string(), 0, 0);
  if (!head) return tl::unexpected(head.error());
  if (head->head.cov.size() == 0) return Found();
  return Found(registration::CommissionedHead::calibrated(head->head));
}

Result<registration::StationScan> read_station(const StitchTask& task, const StitchTask::Station& station) {
  registration::StationScan scan;
  scan.name = station.name;
  scan.axis_mm = station.axis_mm;
  const auto markers = base::read_scan_markers(station.scan);
  if (!markers) return tl::unexpected(markers.error());
  for (const base::ReferencePoint& marker : *markers) scan.markers.push_back({marker.id, marker.xyz_mm, *marker.cov_mm2});
  const auto cloud = base::read_ply(station.scan / "cloud.ply");
  if (!cloud) return tl::unexpected(cloud.error());
  auto surface = registration::Surface::make(*cloud, task.surface);
  if (!surface)
    return fail(surface.error().code, fmt::format("{}: {}", (station.scan / "cloud.ply").string(), surface.error().message));
  scan.surface = *std::move(surface);
  return scan;
}

/// The largest step of a seam, and what else a user must know before he trusts the cloud.
std::vector<base::Verdict> verdicts_of(const base::Stitching& stitching, const JobLimits& limits) {
  std::vector<base::Verdict> verdicts;
  double step = 0.0;
  double sigma = 0.0;
  for (const base::StitchedOverlap& overlap : stitching.overlaps) {
    for (const base::OverlapCell& cell : overlap.cells) {
      if (std::abs(cell.difference_mm) <= step) continue;
      step = std::abs(cell.difference_mm);
      sigma = cell.sigma_mm;
    }
  }
  if (!stitching.overlaps.empty()) {
    verdicts.push_back({"largest step of a seam", step, limits.seam_mm, "mm",
                        "limits.seam_mm: the accuracy that is asked of the hole's edge",
                        base::judge_upper_limit(step, limits.seam_mm, 2.0 * sigma)});
  }
  if (stitching.head) {
    verdicts.push_back({"change of the calibration, in its sigmas", stitching.calibration_shift, limits.calibration_change, "",
                        "limits.calibration_change: a calibration that holds never needs it",
                        base::judge_upper_limit(stitching.calibration_shift, limits.calibration_change, 0.0)});
  }
  double off_axis = 0.0;
  bool on_axis = false;
  for (const base::StitchedStation& station : stitching.stations) {
    on_axis = on_axis || station.off_axis.has_value();
    off_axis = std::max(off_axis, station.off_axis_w);
  }
  if (on_axis) {
    verdicts.push_back({"largest deviation from the axis, w", off_axis, limits.off_axis_w, "",
                        "limits.off_axis_w: 0.1 % two-sided", base::judge_upper_limit(off_axis, limits.off_axis_w, 0.0)});
  }
  return verdicts;
}

std::string summary_of(const base::Stitching& stitching, std::size_t points) {
  double worst = 0.0;
  std::string direction;
  for (const base::StitchedStation& station : stitching.stations) {
    for (const base::DirectionKnowledge& one : station.directions) {
      if (one.angle || one.sigma <= worst) continue;
      worst = one.sigma;
      direction = one.name;
    }
  }
  return fmt::format(
      "{} stations, {} overlaps, {} markers ({} left out), {} rounds of ICP, least known {} {:.3f} mm, {} points",
      stitching.stations.size(), stitching.overlaps.size(), stitching.markers.size(), stitching.rejected.size(),
      stitching.iterations.size(), direction.empty() ? "direction" : direction, worst, points);
}

/// Files of the result, then its publication.
Result<StepOutcome> write(ResultFolder& folder, const fs::path& out, const base::Stitching& stitching,
                          const base::Cloud& merged, const std::vector<base::ResultInput>& inputs, const ordered_json& options,
                          const JobLimits& limits, const std::string& title, const Session& session) {
  const base::ResultEnvelope envelope{"stitch", stitching.frame, inputs, verdicts_of(stitching, limits), stitching.warnings};
  if (auto written = base::write_ply(folder.path() / "cloud.ply", merged); !written) return fail(std::move(written));
  if (auto written = report::write_stitching_tables(folder.path(), stitching); !written) return fail(std::move(written));
  if (auto written = base::write_covariance(folder.path(), {stitching.covariance, stitching.labels}); !written)
    return fail(std::move(written));
  const std::string html = report::stitching_report(
      stitching, merged, {"Stitched cloud", title, envelope, options.dump(2), overview_of(out, session)});
  const ordered_json result = base::result_json(envelope, options, base::stitching_json(stitching));
  if (auto published = publish(folder, html, result); !published) return fail(std::move(published));
  return StepOutcome{out, summary_of(stitching, merged.points.size()), false, outcome_of(result)};
}

}  // namespace

Result<StitchTask> stitch_task(const Job& job, const fs::path& results) {
  StitchTask task;
  task.base_folder = job.folder;
  task.title = job.name;
  task.limits = job.limits;
  if (fs::exists(results / "commission" / "result.json")) task.commission = results / "commission";
  if (fs::exists(results / "calibrate" / "result.json")) task.calibration = results / "calibrate";
  if (job.hole && job.hole->markers) {
    task.reference = job.resolve(*job.hole->markers);
    task.reference_in_part = job.hole->markers_in_part;
  }
  for (const JobStation& station : job.stations) {
    const fs::path scan = results / "scan" / station.name;
    if (!station.scan || !fs::exists(scan / "result.json")) continue;
    task.stations.push_back({station.name, task.commission ? std::optional(station.axis_mm) : std::nullopt, scan});
  }
  if (task.stations.empty()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: stitch needs the scans of the stations, none are in {}; run 'scan' first", job.file.string(),
                            (results / "scan").string()));
  }
  return task;
}

Result<StepOutcome> stitch_step(const StitchTask& task, const fs::path& out, Session& session) {
  const ordered_json options = effective_options(task);
  const auto inputs = hashed_inputs(files_of(task), task.base_folder);
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));
  const base::Progress progress = session.progress();
  registration::StitchInput input;
  auto commissioned = read_commissioned(task);
  if (!commissioned) return fail(std::move(commissioned));
  input.commissioned = *std::move(commissioned);
  if (task.reference) {
    auto reference = read_reference(task);
    if (!reference) return fail(std::move(reference));
    input.reference = *std::move(reference);
  }
  for (const StitchTask::Station& station : task.stations) {
    if (progress.cancelled()) return base::cancelled("stitch");
    progress("reading clouds", input.stations.size(), task.stations.size());
    auto scan = read_station(task, station);
    if (!scan) return fail(std::move(scan));
    input.stations.push_back(*std::move(scan));
  }
  auto stitching = registration::stitch(input, task.stitch, progress);
  if (!stitching) return fail(std::move(stitching));
  if (!task.commission && !task.calibration) {
    stitching->warnings.push_back({"calibration_not_modelled", "",
                                   "without the result of commission or calibrate the head's calibration is taken as exact"});
  }
  const std::optional<base::Head> head = input.commissioned ? std::optional(input.commissioned->head) : std::nullopt;
  registration::CloudMerger merger(*stitching, task.merge, head);
  for (std::size_t k = 0; k < task.stations.size(); ++k) {
    if (progress.cancelled()) return base::cancelled("stitch");
    progress("merging clouds", k, task.stations.size());
    const auto cloud = base::read_ply(task.stations[k].scan / "cloud.ply");
    if (!cloud) return tl::unexpected(cloud.error());
    if (auto added = merger.add(static_cast<int>(k), *cloud); !added) return fail(std::move(added));
  }
  return write(*folder, out, *stitching, merger.finish(), *inputs, options, task.limits, task.title, session);
}

Result<StepOutcome> surface_stitch_step(const SurfaceStitchTask& task, const fs::path& out, Session& session) {
  ordered_json options = options_json(task.surface, task.stitch, task.merge);
  options["surface_only"] = true;
  const auto inputs = hashed_inputs(task.clouds, out.parent_path());
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));
  registration::StitchInput input;
  registration::StitchOptions stitch = task.stitch;
  registration::MergeOptions merge = task.merge;
  double noise = 0.0;
  double size = 0.0;
  for (const fs::path& path : task.clouds) {
    const auto cloud = base::read_ply(path);
    if (!cloud) return tl::unexpected(cloud.error());
    auto surface = registration::Surface::make(*cloud, task.surface);
    if (!surface) return fail(surface.error().code, fmt::format("{}: {}", path.string(), surface.error().message));
    noise = std::max(noise, surface->noise_mm());
    size = std::max(size, (surface->most_mm() - surface->least_mm()).norm());
    registration::StationScan& station = input.stations.emplace_back();
    station.name = path.stem().string();
    station.surface = *std::move(surface);
    station.start = base::Pose{};
  }
  for (std::size_t k = 1; k < input.stations.size(); ++k) {
    // Files of one name in different folders.
    const bool twice = std::any_of(input.stations.begin(), input.stations.begin() + static_cast<std::ptrdiff_t>(k),
                                   [&](const auto& other) { return other.name == input.stations[k].name; });
    if (twice) input.stations[k].name += fmt::format(" ({})", k + 1);
  }
  if (!stitch.start_reach_mm) stitch.start_reach_mm = kReachOfSize * size;
  if (!merge.sigma_mm) merge.sigma_mm = noise;
  const auto stitching = registration::stitch(input, stitch, session.progress());
  if (!stitching) return tl::unexpected(stitching.error());
  if (stitching->overlaps.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "the clouds do not overlap where they lie; bring them nearer, or give --reach-mm");
  }
  registration::CloudMerger merger(*stitching, merge);
  for (std::size_t k = 0; k < task.clouds.size(); ++k) {
    const auto cloud = base::read_ply(task.clouds[k]);
    if (!cloud) return tl::unexpected(cloud.error());
    if (auto added = merger.add(static_cast<int>(k), *cloud); !added) return fail(std::move(added));
  }
  return write(*folder, out, *stitching, merger.finish(), *inputs, options, JobLimits{}, task.title, session);
}

}  // namespace crosstie::app
