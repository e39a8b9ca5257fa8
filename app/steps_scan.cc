// fringe images of two cameras -> cloud with a sigma for each point

#include "app/steps_scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/head_files.h"
#include "app/result_folder.h"
#include "app/scan_edges.h"
#include "app/scan_head.h"
#include "app/scan_markers.h"
#include "app/scan_view.h"
#include "base/depth_image.h"
#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern_sequence.h"
#include "base/pcd.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/scan_summary.h"
#include "report/scan_report.h"
#include "scan/head_test.h"
#include "scan/markers.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::PhaseMap;
using base::Result;
using nlohmann::ordered_json;

ordered_json effective_options(const ScanTask& task) {
  std::error_code ignored;
  const bool folder = task.head.find(',') == std::string::npos;
  ordered_json options = {
      {"head", folder ? fs::proximate(task.head, task.base_folder, ignored).generic_string() : task.head},
      {"max_phase_sigma_rad", task.decode.max_phase_sigma_rad},
      {"min_modulation", task.decode.min_modulation},
      {"max_residual_ratio", task.decode.max_residual_ratio},
      {"min_word_agreement", task.decode.min_word_agreement},
      {"max_movement_px", task.decode.max_movement_px},
      {"max_light_change", task.decode.max_light_change},
      {"correct_ripple", task.decode.correct_ripple},
      {"min_depth_mm", task.match.min_depth_mm},
      {"max_depth_mm", task.match.max_depth_mm},
      {"min_slope", task.match.min_slope},
      {"max_epipolar_sigmas", task.match.max_epipolar_sigmas},
      {"max_epipolar_px", task.match.max_epipolar_px},
      {"guard_px", task.match.guard_px},
      {"guard_creases", task.match.guard_creases},
      {"max_grazing_rad", task.cloud.max_grazing_rad},
      {"max_surface_sigmas", task.cloud.max_surface_sigmas},
      {"filter_radius_px", task.cloud.filter_radius_px},
      {"edge_half_piece_px", task.edges.half_piece_px},
      {"edge_reach_px", task.edges.reach_px},
      {"edge_min_step_sigmas", task.edges.min_step_sigmas},
      {"edge_min_paint_step", task.edges.min_paint_step},
      {"write_covariance", task.write_covariance},
      {"write_pcd", task.write_pcd},
  };
  if (task.max_off_curve_px) options["max_off_curve_px"] = *task.max_off_curve_px;
  if (task.markers) {
    options["markers"] = {{"family", task.markers->family.name},
                          {"ids", task.markers->options.ids},
                          {"thickness_mm", task.markers->thickness_mm},
                          {"dot_diameter_mm", task.markers->dot_diameter_mm.value_or(0.0)}};
  }
  for (std::size_t camera = 0; camera < 2; ++camera) {
    if (task.white_levels[camera]) options["white_level"][camera == 0 ? "left" : "right"] = *task.white_levels[camera];
  }
  if (task.decode.noise) options["noise"] = {task.decode.noise->read, task.decode.noise->shot};
  return options;
}

fs::path image_path(const ScanTask& task, const base::Pattern& pattern, std::size_t camera) {
  return (camera == 0 ? task.left : task.right) / pattern.files[camera];
}

Result<std::vector<base::ResultInput>> inputs_of(const ScanTask& task, const base::PatternSequence& sequence,
                                                 const std::vector<fs::path>& head_files) {
  std::vector<fs::path> paths = head_files;
  paths.push_back(task.manifest);
  for (const base::Pattern& pattern : sequence.patterns) {
    for (std::size_t camera = 0; camera < 2; ++camera) paths.push_back(image_path(task, pattern, camera));
  }
  return hashed_inputs(paths, task.base_folder);
}

/// One camera while its images come in.
struct Camera {
  std::optional<scan::Decoder> decoder;
  std::optional<base::Image> white;  ///< for markers
  double white_level = 0.0;
};

Result<> add_image(const ScanTask& task, const base::PatternSequence& sequence, std::size_t index, std::size_t camera,
                   Camera& state) {
  const base::Pattern& pattern = sequence.patterns[index];
  const fs::path path = image_path(task, pattern, camera);
  auto image = base::read_image(path);
  if (!image) return base::fail(std::move(image));
  if (task.white_levels[camera]) image->set_white_level(*task.white_levels[camera]);
  state.white_level = image->white_level();
  if (task.markers && !state.white && pattern.kind == base::PatternKind::kWhite) state.white = *image;
  if (!state.decoder) {
    auto made = scan::Decoder::make(sequence, image->width(), image->height(), task.decode);
    if (!made) return base::fail(std::move(made));
    state.decoder.emplace(*std::move(made));
  }
  auto added = state.decoder->add(static_cast<int>(index), *std::move(image));
  if (!added) return base::fail(added.error().code, fmt::format("{}: {}", path.string(), added.error().message));
  return {};
}

/// The phases of both cameras, and the images for their markers.
struct Decoded {
  std::array<PhaseMap, 2> maps;
  std::array<base::Image, 2> for_markers;
};

/// Image by image, and then what needs all of them, both cameras' at once. The first camera's progress is that of both.
Result<Decoded> decode_cameras(const ScanTask& task, const base::PatternSequence& sequence, const base::Progress& progress) {
  std::array<Camera, 2> cameras;
  const base::Progress silent{{}, progress.stop};
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    progress("images", i, sequence.patterns.size());
    auto added = base::parallel_for(2, task.decode.threads, "images", silent,
                                    [&](std::size_t camera) { return add_image(task, sequence, i, camera, cameras[camera]); });
    if (!added) return base::fail(std::move(added));
  }
  Decoded result;
  const auto done = base::parallel_for(2, task.decode.threads, "phases", silent, [&](std::size_t c) -> Result<> {
    auto map = cameras[c].decoder->finish(c == 0 ? progress : silent);
    if (!map && map.error().code == ErrorCode::kBadInput)
      return base::fail(ErrorCode::kBadInput,
                        fmt::format("{}: {}", (c == 0 ? task.left : task.right).string(), map.error().message));
    if (!map) return base::fail(std::move(map));
    cameras[c].decoder.reset();
    result.maps[c] = *std::move(map);
    if (task.markers) result.for_markers[c] = marker_image(cameras[c].white, result.maps[c], cameras[c].white_level);
    return {};
  });
  if (!done) return tl::unexpected(done.error());
  return result;
}

scan::MarkerOptions marker_options(const ScanMarkers& markers) {
  scan::MarkerOptions options;
  if (markers.family.border_outer > 0.0) options.mask_radii = markers.family.border_outer;
  options.surface_radii = std::max(options.surface_radii, 2.0 * options.mask_radii);
  options.thickness_mm = markers.thickness_mm;
  options.dot_radius_mm = 0.5 * markers.dot_diameter_mm.value_or(0.0);
  return options;
}

/// Finds the markers, takes the points on them out of the cloud and measures them.
Result<> look_for_markers(const ScanTask& task, const base::Head& head, const std::array<base::Image, 2>& images,
                          ScanParts& parts, Session& session) {
  auto found = scan_markers(task, images, session);
  if (!found) return base::fail(std::move(found));
  parts.observations = *std::move(found);
  const scan::MarkerOptions options = marker_options(*task.markers);
  const auto& [left, right] = parts.observations;
  parts.on_markers = scan::mask_markers(parts.cloud, head, left, right, options);
  auto markers = scan::marker_points(parts.cloud, head, left, right, task.cloud.filter_radius_px, options);
  if (!markers) return base::fail(std::move(markers));
  parts.markers = *std::move(markers);
  if (!parts.head_test.done()) {
    parts.head_test = scan::test_head(head, scan::marker_samples(parts.markers, head), "markers");
    if (auto ok = scan::judge_head(parts.head_test, off_curve_limit_px(task, head)); !ok) return ok;
  }
  return {};
}

Result<> write_markers(const ScanParts& parts, const fs::path& folder) {
  auto written = base::write_observations(folder / "markers.csv", {parts.observations.begin(), parts.observations.end()});
  if (!written) return written;
  base::PointList list;
  for (const base::ScannedMarker& marker : parts.markers)
    list.points.push_back({marker.id, marker.p_in_rig_mm, marker.cov_mm2 + marker.calibration_cov_mm2});
  return base::write_point_list(folder / "marker_points.csv", list);
}

/// The noise part: sigma^2 along the ray of each point.
void add_covariance(base::Cloud& cloud) {
  const std::vector<double>& sigma = *cloud_field(cloud, "sigma_mm");
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3d ray = cloud.points[i].normalized();
    cloud.cov_mm2.emplace_back(sigma[i] * sigma[i] * ray * ray.transpose());
  }
}

std::string said(const base::ScanSummary& summary) {
  std::string text = fmt::format("{} points, median sigma {:.4f} mm", summary.points, summary.sigma_mm);
  if (summary.markers_wanted) text += fmt::format(", {} markers", summary.markers.size());
  return text;
}

}  // namespace

double off_curve_limit_px(const ScanTask& task, const base::Head& head) {
  constexpr double kCalibrated_px = 0.25;
  constexpr double kUnknown_px = 1.0;
  return task.max_off_curve_px.value_or(head.cov.size() > 0 ? kCalibrated_px : kUnknown_px);
}

Result<StepOutcome> scan_step(const ScanTask& task, const fs::path& out, Session& session) {
  const auto sequence = base::read_pattern_manifest(task.manifest);
  if (!sequence) return tl::unexpected(sequence.error());
  if (sequence->patterns.empty()) return base::fail(ErrorCode::kBadInput, fmt::format("{}: no images", task.manifest.string()));
  const auto info = base::read_image_info(image_path(task, sequence->patterns.front(), 0));
  if (!info) return tl::unexpected(info.error());
  const auto head = read_head(task.head, info->width, info->height);
  if (!head) return tl::unexpected(head.error());
  const ordered_json options = effective_options(task);
  const auto inputs = inputs_of(task, *sequence, head->files);
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const base::Progress progress = session.progress();
  ScanParts parts;
  parts.observations = no_markers(task);
  auto decoded = decode_cameras(task, *sequence, progress);
  if (!decoded) return base::fail(std::move(decoded));
  parts.maps = std::move(decoded->maps);
  auto depths = scan::match(parts.maps[0], parts.maps[1], head->head, task.match, progress);
  if (!depths) return base::fail(std::move(depths));
  parts.depths = *std::move(depths);
  auto tested = tested_head(task, head->head, parts.maps, parts.depths, progress);
  if (!tested) return base::fail(std::move(tested));
  parts.head_test = *std::move(tested);
  auto cloud = scan::make_cloud(parts.depths, parts.maps[0], head->head, task.cloud, progress);
  if (!cloud) return base::fail(std::move(cloud));
  parts.cloud = *std::move(cloud);
  if (task.markers) {
    if (auto done = look_for_markers(task, head->head, decoded->for_markers, parts, session); !done)
      return base::fail(std::move(done));
  }
  auto edges = scan_edges(task, *sequence, head->head, parts, progress);
  if (!edges) return base::fail(std::move(edges));
  parts.edges = *std::move(edges);
  const base::ScanSummary summary = summarise(task, head->head, parts);

  base::ResultEnvelope envelope{"scan", "rig", *inputs, {}, summary.warnings};
  if (summary.head_test.done()) {
    const base::HeadTest& test = summary.head_test;
    const double limit = off_curve_limit_px(task, head->head);
    if (limit > 0.0) {
      envelope.verdicts.push_back({"off the epipolar curves", test.off_px, limit, "px",
                                   "limits.epipolar_px: a calibrated head keeps within a few hundredths of a pixel",
                                   base::judge_upper_limit(test.off_px, limit, 2.0 * test.sigma_px)});
    }
  }
  const ordered_json result = base::result_json(envelope, options, base::scan_json(summary));
  if (task.write_covariance) add_covariance(parts.cloud.cloud);
  if (auto written = base::write_ply(folder->path() / "cloud.ply", parts.cloud.cloud); !written)
    return base::fail(std::move(written));
  if (task.write_pcd) {
    if (auto done = base::write_pcd(folder->path() / "cloud.pcd", parts.cloud.cloud); !done) return base::fail(std::move(done));
  }
  auto written =
      base::write_depth_tiff(folder->path() / "depth.tiff", parts.depths.width, parts.depths.height, parts.cloud.depth_mm);
  if (!written) return base::fail(std::move(written));
  if (auto done = write_markers(parts, folder->path()); !done) return base::fail(std::move(done));
  if (auto done = base::write_edge_pixels(folder->path() / "edge_pixels.csv", parts.edges); !done)
    return base::fail(std::move(done));
  const std::string html =
      report::scan_report(summary, {"Scan", task.title, envelope, options.dump(2), overview_of(out, session)});
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out, said(summary), false, outcome_of(result)};
}

}  // namespace crosstie::app
