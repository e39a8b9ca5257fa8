#include "edge/detail/rim_normals.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "edge/detail/view_surface.h"
#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

/// A cell's surface as one station saw it, wide enough for its slopes; in the frame.
struct Slope {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt_variance = Eigen::Vector2d::Zero();  ///< across the rim and along it
  double extent_mm = 0.0;                                   ///< of its depths, along the rim
};

std::optional<Slope> slope_at(CameraView& left, const base::Pose& frame_from_rig, const FusedCell& cell,
                              const HoleEdgeOptions& options) {
  constexpr double kStep_mm = 0.5;
  constexpr double kMostReach_px = 60.0;  // as many pixels tell a slope well enough, and the face of a small bore ends
  const base::Pose rig_from_frame = frame_from_rig.inverse();
  const Eigen::Vector3d across = rig_from_frame.rotation * cell.across;
  const Eigen::Vector3d along = rig_from_frame.rotation * cell.across.cross(cell.normal);
  const Eigen::Vector3d p = rig_from_frame * cell.point_mm;
  const auto at = left.camera().project(p);
  const auto inside = left.camera().project(p - kStep_mm * across);
  const auto beside = left.camera().project(p + kStep_mm * along);
  if (!at || !inside || !beside) return std::nullopt;
  // Square to the edge in the image, as edge pixels have it.
  const Eigen::Vector2d edge = (*beside - *at).normalized();
  Eigen::Vector2d out(-edge.y(), edge.x());
  if (out.dot(*at - *inside) < 0.0) out = -out;
  const double px_per_mm = out.dot(*at - *inside) / kStep_mm;
  const double reach_px = std::clamp(options.normal_reach_mm * px_per_mm, options.surface_reach_px, kMostReach_px);
  Eigen::Matrix3d axes;
  axes << across, along, rig_from_frame.rotation * cell.normal;
  const auto found = slope_before(left, *at, out, options.surface_guard_px, reach_px, p, axes);
  if (!found) return std::nullopt;
  const Eigen::Vector3d normal = axes.col(2) - found->slope(0) * across - found->slope(1) * along;
  return Slope{frame_from_rig.rotation * normal.normalized(), found->cov.diagonal(),
               found->extent_px * kStep_mm / (*beside - *at).norm()};
}

}  // namespace

double turn_normals(std::vector<FusedCell>& cells, std::span<const StationView> stations, const HoleEdgeOptions& options) {
  std::vector<Eigen::Vector3d> normals(cells.size(), Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector2d> variances(cells.size(), Eigen::Vector2d::Zero());
  std::vector<double> weights(cells.size(), 0.0);
  std::vector<double> extents;
  for (std::size_t s = 0; s < stations.size(); ++s) {
    CameraView left(stations[s].head->left, *stations[s].depth_mm, *stations[s].sigma_mm);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const auto saw = [&](const Voice& voice) { return voice.station == static_cast<int>(s); };
      if (std::none_of(cells[i].voices.begin(), cells[i].voices.end(), saw)) continue;
      const auto slope = slope_at(left, stations[s].frame_from_rig, cells[i], options);
      if (!slope || slope->normal.dot(cells[i].normal) < std::cos(options.max_turn_rad)) continue;
      normals[i] += slope->normal / slope->tilt_variance.sum();
      weights[i] += 1.0 / slope->tilt_variance.sum();
      variances[i] += slope->tilt_variance / std::pow(slope->tilt_variance.sum(), 2);
      extents.push_back(slope->extent_mm);
    }
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (weights[i] == 0.0) continue;
    FusedCell& cell = cells[i];
    cell.normal = normals[i].normalized();
    cell.tilt_sigma_rad = variances[i].cwiseSqrt() / weights[i];
    cell.across = (cell.across - cell.across.dot(cell.normal) * cell.normal).normalized();
  }
  return extents.empty() ? 0.0 : math::median(extents);
}

}  // namespace crosstie::edge::detail
