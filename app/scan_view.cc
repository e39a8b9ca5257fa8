// What a scan found, for result and report.

#include "app/scan_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

#include <fmt/core.h>

namespace crosstie::app {
namespace {

using base::PhaseMap;

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

base::ScannedCamera describe(const std::string& name, const PhaseMap& map) {
  constexpr std::size_t kEvery = 11;
  base::ScannedCamera camera;
  camera.name = name;
  camera.counts = map.counts;
  camera.noise = map.noise;
  camera.noise_given = map.noise_given;
  camera.residual_ratio = map.residual_ratio;
  const base::PhasePlane& plane = map.x ? *map.x : *map.y;
  std::vector<double> light, modulation, sigma;
  for (std::size_t i = 0; i < map.status.size(); i += kEvery) {
    if (map.status[i] != base::PhaseStatus::kValid) continue;
    light.push_back(map.light[i]);
    modulation.push_back(plane.modulation[i]);
    sigma.push_back(2.0 * std::numbers::pi * static_cast<double>(plane.sigma_turns[i]));
  }
  camera.stillness = map.stillness;
  camera.light = quantile(std::move(light), 0.5);
  camera.modulation = quantile(std::move(modulation), 0.5);
  camera.sigma_phase_rad = quantile(std::move(sigma), 0.5);
  for (const auto* axis : {&map.x, &map.y}) {
    if (!*axis) continue;
    camera.ripple_rad = std::max(camera.ripple_rad, 2.0 * std::numbers::pi * (*axis)->ripple_turns);
    camera.word_agreement = std::min(camera.word_agreement, (*axis)->word_agreement);
    camera.repaired += (*axis)->repaired;
  }
  return camera;
}

/// Means over cells of the left image.
void fill_cells(const scan::DepthMap& depths, const scan::ScanCloud& cloud, base::ScanSummary& summary) {
  constexpr int kColumns = 48;
  const int cell = std::max(1, depths.width / kColumns);
  const int columns = (depths.width + cell - 1) / cell;
  const int rows = (depths.height + cell - 1) / cell;
  summary.cell_px = cell;
  summary.depth_mm = Eigen::MatrixXd::Zero(rows, columns);
  summary.sigma_cells_mm = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::MatrixXd counts = Eigen::MatrixXd::Zero(rows, columns);
  for (int y = 0; y < depths.height; ++y) {
    for (int x = 0; x < depths.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) + static_cast<std::size_t>(x);
      if (std::isnan(cloud.depth_mm[at])) continue;
      summary.depth_mm(y / cell, x / cell) += static_cast<double>(cloud.depth_mm[at]);
      summary.sigma_cells_mm(y / cell, x / cell) += static_cast<double>(depths.sigma_mm[at]);
      counts(y / cell, x / cell) += 1.0;
    }
  }
  summary.depth_mm = summary.depth_mm.cwiseQuotient(counts);  // 0 / 0 is what is wanted: not a number
  summary.sigma_cells_mm = summary.sigma_cells_mm.cwiseQuotient(counts);
}

std::vector<base::Warning> warnings_of(const base::ScanSummary& summary, const ScanTask& task) {
  constexpr double kDisturbed = 0.02;
  constexpr double kSaturated = 0.02;
  std::vector<base::Warning> warnings;
  if (!summary.head_test.done()) {
    warnings.push_back({"calibration_not_tested", "",
                        "not testable: with one direction of fringes, a surface without texture and fewer than three markers a "
                        "scan does not test the calibration of its head; show both directions"});
  } else if (!summary.both_axes) {
    warnings.push_back(
        {"calibration_tested_in_part", "",
         fmt::format("with one direction of fringes, {} of {} places tell pitch and roll of the cameras; yaw and "
                     "baseline are not testable; show both directions",
                     summary.head_test.source, summary.head_test.samples)});
  }
  constexpr double kOffCurve_px = 0.1;
  if (summary.head_test.done() && summary.head_test.off_px > kOffCurve_px + 3.0 * summary.head_test.sigma_px) {
    const auto most = std::max_element(summary.head_test.terms.begin(), summary.head_test.terms.end(),
                                       [](const auto& a, const auto& b) { return a.explained < b.explained; });
    warnings.push_back(
        {"off_curve", "",
         fmt::format("images of the same lie {:.2f} +- {:.2f} px off the epipolar curves, as if the right camera had "
                     "changed by {} {:+.2f} mrad since it was calibrated; calibrate again, or let the head warm up",
                     summary.head_test.off_px, summary.head_test.sigma_px, most->name, 1e3 * most->value_rad)});
  }
  for (const base::ScannedCamera& camera : summary.cameras) {
    const auto count = [&](base::PhaseStatus status) {
      return static_cast<double>(camera.counts[static_cast<std::size_t>(status)]);
    };
    const double lit =
        count(base::PhaseStatus::kValid) + count(base::PhaseStatus::kDisturbed) + count(base::PhaseStatus::kSaturated);
    if (count(base::PhaseStatus::kDisturbed) > kDisturbed * lit) {
      warnings.push_back(
          {"disturbed", camera.name,
           fmt::format("{:.1f} % of the pixels do not see shifted fringes: did something move, or did other light change?",
                       100.0 * count(base::PhaseStatus::kDisturbed) / lit)});
    }
    constexpr double kLightChange = 0.02;
    if (std::abs(camera.stillness.light_change.value_or(0.0)) > kLightChange) {
      warnings.push_back(
          {"light_changed", camera.name,
           fmt::format("the projector's light changed by {:+.1f} % from the first to the last image; let it warm up",
                       100.0 * *camera.stillness.light_change)});
    }
    if (std::abs(camera.stillness.ambient_change.value_or(0.0)) > kLightChange) {
      warnings.push_back({"light_changed", camera.name,
                          fmt::format("other light changed by {:+.1f} % of the projector's from the first to the last image",
                                      100.0 * *camera.stillness.ambient_change)});
    }
    if (count(base::PhaseStatus::kSaturated) > kSaturated * lit) {
      warnings.push_back(
          {"saturated", camera.name,
           fmt::format("{:.1f} % of the lit pixels are saturated in too many images; expose less, or take an exposure series",
                       100.0 * count(base::PhaseStatus::kSaturated) / lit)});
    }
  }
  if (task.markers && task.markers->family.tag) {
    warnings.push_back({"tags_not_masked", "",
                        "the cloud holds the points on tags: a tag's corners give its middle, not how large its plate is"});
  }
  if (task.markers && summary.markers.empty()) {
    warnings.push_back({"no_markers", "",
                        fmt::format("no marker of {} is seen by both cameras ({} by the left one, {} by the right one)",
                                    task.markers->family.name, summary.markers_read[0], summary.markers_read[1])});
  }
  return warnings;
}

base::ScannedEdges describe(const base::EdgePixels& edges) {
  const auto counts = edges.counts();
  std::vector<double> sigmas;
  for (const base::EdgePixel& pixel : edges.pixels) {
    if (pixel.kind == base::EdgeClass::kMaterial) sigmas.push_back(pixel.sigma_px);
  }
  return {counts[0], counts[1], counts[2], edges.blur_px, edges.piece_px, quantile(std::move(sigmas), 0.5)};
}

}  // namespace

base::ScanSummary summarise(const ScanTask& task, const base::Head& head, const ScanParts& parts) {
  const auto& [maps, depths, cloud] = std::tie(parts.maps, parts.depths, parts.cloud);
  constexpr std::size_t kEvery = 17;
  constexpr std::size_t kSample = 50000;
  base::ScanSummary summary;
  summary.name = task.title;
  summary.width = depths.width;
  summary.height = depths.height;
  summary.head_test = parts.head_test;
  summary.both_axes = !depths.epipolar_px.empty();
  summary.cameras = {describe(head.left_name, maps[0]), describe(head.right_name, maps[1])};
  for (std::size_t camera = 0; camera < parts.edges.size(); ++camera) summary.edges[camera] = describe(parts.edges[camera]);
  summary.points = static_cast<std::int64_t>(cloud.cloud.points.size());
  summary.guarded = depths.guarded;
  summary.unmatched = depths.unmatched;
  summary.off_curve = depths.off_curve;
  summary.grazing = cloud.grazing;
  summary.off_surface = cloud.off_surface;
  const std::vector<double>& sigma = *cloud_field(cloud.cloud, "sigma_mm");
  summary.sigma_mm = quantile(sigma, 0.5);
  summary.sigma_p95_mm = quantile(sigma, 0.95);
  if (const auto* calibration = cloud_field(cloud.cloud, "calibration_mm"))
    summary.calibration_mm = quantile(*calibration, 0.5);
  if (summary.both_axes) {
    summary.epipolar_median_px = depths.epipolar_median_px;
    summary.epipolar_mad_px = depths.epipolar_mad_px;
    for (std::size_t i = 0; i < depths.epipolar_px.size(); i += kEvery) {
      if (!std::isnan(depths.epipolar_px[i])) summary.epipolar_px.push_back(static_cast<double>(depths.epipolar_px[i]));
    }
  }
  const std::size_t step = cloud.cloud.points.size() / kSample + 1;
  for (std::size_t i = step / 2; i < cloud.cloud.points.size(); i += step) {
    const Eigen::Vector3d& point = cloud.cloud.points[i];
    summary.sample.emplace_back(point.x(), point.y(), point.z(), sigma[i]);
  }
  std::vector<double> depth;
  for (const Eigen::Vector3d& point : cloud.cloud.points) depth.push_back(point.z());
  summary.depth_min_mm = quantile(depth, 0.0);
  summary.depth_max_mm = quantile(std::move(depth), 1.0);
  summary.correlation_length_mm = cloud.correlation_length_mm;
  fill_cells(depths, cloud, summary);
  if (task.markers) {
    summary.markers_wanted = true;
    summary.marker_thickness_mm = task.markers->thickness_mm;
    summary.on_markers = parts.on_markers;
    summary.markers = parts.markers;
    for (std::size_t camera = 0; camera < 2; ++camera) {
      summary.markers_read[camera] =
          std::count_if(parts.observations[camera].observations.begin(), parts.observations[camera].observations.end(),
                        [](const auto& seen) { return seen.status == base::ObservationStatus::kCoded; });
    }
  }
  summary.warnings = warnings_of(summary, task);
  return summary;
}

const std::vector<double>* cloud_field(const base::Cloud& cloud, const std::string& name) {
  for (const base::CloudField& candidate : cloud.fields) {
    if (candidate.name == name) return &candidate.values;
  }
  return nullptr;
}

}  // namespace crosstie::app
