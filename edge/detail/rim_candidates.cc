#include "edge/detail/rim_candidates.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "edge/detail/view_surface.h"
#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr std::size_t kLeastCandidates = 20;
constexpr double kRoiMargin_px = 40.0;  // of depths beside the region

Eigen::Matrix<double, 6, 1> monomials(const Eigen::Vector3d& local) {
  return (Eigen::Matrix<double, 6, 1>() << 1.0, local.x(), local.y(), local.x() * local.x(), local.x() * local.y(),
          local.y() * local.y())
      .finished();
}

/// Where the ray of a pixel meets a surface, in the camera's frame.
std::optional<Eigen::Vector3d> meet(const base::Camera& camera, const LocalSurface& surface, const Eigen::Vector2d& at_px) {
  const auto ray = camera.unproject(at_px);
  if (!ray) return std::nullopt;
  const double inverse = surface.plane.dot(*ray);
  if (!(inverse > 0.0)) return std::nullopt;
  return Eigen::Vector3d(*ray / inverse);
}

/// One edge pixel on its surface. The phases directly beyond an edge go on behind paint, and also where a chamfer bends away: the depths farther on tell.
std::optional<RimCandidate> candidate(CameraView& view, const base::EdgePixel& edge, double piece_px,
                                      const HoleEdgeOptions& options) {
  constexpr double kStep_px = 0.5;
  const auto surface = surface_before(view, edge.at_px, edge.out, options.surface_guard_px, options.surface_reach_px);
  if (!surface) return std::nullopt;
  if (edge.kind == base::EdgeClass::kPaint &&
      goes_on(view, *surface, edge.at_px, edge.out, edge.band_px + options.surface_guard_px))
    return std::nullopt;
  LocalSurface here = *surface;
  // The fitted value at the edge, on the plane's directions.
  const auto ray = view.camera().unproject(edge.at_px);
  if (!ray) return std::nullopt;
  here.plane.z() += surface->inverse_depth - here.plane.dot(*ray / ray->z());
  const Eigen::Vector2d along(-edge.out.y(), edge.out.x());
  const auto at = meet(view.camera(), here, edge.at_px);
  const auto before = meet(view.camera(), here, edge.at_px - kStep_px * edge.out);
  const auto beyond = meet(view.camera(), here, edge.at_px + kStep_px * edge.out);
  const auto left = meet(view.camera(), here, edge.at_px - kStep_px * along);
  const auto right = meet(view.camera(), here, edge.at_px + kStep_px * along);
  if (!at || !before || !beyond || !left || !right) return std::nullopt;
  RimCandidate result;
  result.point_mm = *at;
  result.normal = here.normal;
  const Eigen::Vector3d tangent = (*right - *left).normalized();
  const Eigen::Vector3d across = (*beyond - *before) / (2.0 * kStep_px);  // mm per px
  const Eigen::Vector3d in_surface = across - tangent.dot(across) * tangent;
  const double scale = in_surface.norm();
  result.out = in_surface / scale;
  result.ray = ray->normalized();
  result.sigma_mm = edge.sigma_px * scale;
  result.band_mm = edge.band_px * scale;
  result.piece_mm = piece_px * (*right - *left).norm() / (2.0 * kStep_px);
  result.surface_piece_mm = result.piece_mm / piece_px * surface->piece_px;
  result.depths_mm = result.piece_mm / piece_px * surface->extent_px;
  for (const auto& [i, direction] : {std::pair{0, result.out}, {1, tangent}})
    result.tilt_sigma_rad(i) = std::sqrt(direction.dot(surface->plane_cov * direction)) / surface->plane.norm();
  const double z = at->z();
  result.surface_sigma_mm = surface->sigma * z * z * std::abs(result.normal.dot(*ray / ray->z()));
  return result;
}

}  // namespace

StationCandidates candidates_of(const StationView& view, int station, const HoleEdgeOptions& options,
                                HoleEdge::Counts& counts) {
  StationCandidates result;
  const base::Head& head = *view.head;
  const std::array<double, 4> roi =
      options.roi_px.value_or(std::array<double, 4>{0.0, 0.0, head.left.width_px() - 1.0, head.left.height_px() - 1.0});
  const Eigen::Vector2d middle(0.5 * (roi[0] + roi[2]), 0.5 * (roi[1] + roi[3]));
  const std::array<double, 4> wide = {roi[0] - kRoiMargin_px, roi[1] - kRoiMargin_px, roi[2] + kRoiMargin_px,
                                      roi[3] + kRoiMargin_px};
  const Eigen::Vector3d base_direction = head.right_from_left.inverse().translation_mm.normalized();
  for (int camera = 0; camera < 2; ++camera) {
    const base::EdgePixels& edges = *view.edges[static_cast<std::size_t>(camera)];
    CameraView depths = camera == 0 ? CameraView(head.left, *view.depth_mm, *view.sigma_mm)
                                    : right_view(head, *view.depth_mm, *view.sigma_mm, wide);
    const base::Pose rig_from_camera = camera == 0 ? base::Pose{} : head.right_from_left.inverse();
    for (const base::EdgePixel& edge : edges.pixels) {
      if (camera == 0 &&
          (edge.at_px.x() < roi[0] || edge.at_px.y() < roi[1] || edge.at_px.x() > roi[2] || edge.at_px.y() > roi[3]))
        continue;
      auto found = candidate(depths, edge, edges.piece_px, options);
      if (!found) {
        if (edge.kind != base::EdgeClass::kPaint) ++counts.no_surface;
        continue;
      }
      found->station = station;
      found->camera = camera;
      found->point_in_rig_mm = rig_from_camera * found->point_mm;
      const double distance_mm = found->point_mm.norm();
      const auto seen = head.left.project(found->point_in_rig_mm);
      if (!seen || seen->x() < roi[0] || seen->y() < roi[1] || seen->x() > roi[2] || seen->y() > roi[3]) continue;
      found->left_px = *seen;
      found->angle_rad = std::atan2(seen->y() - middle.y(), seen->x() - middle.x());
      const Eigen::Quaterniond turn = view.frame_from_rig.rotation * rig_from_camera.rotation;
      found->point_mm = view.frame_from_rig * found->point_in_rig_mm;
      found->normal = turn * found->normal;
      found->out = turn * found->out;
      found->ray = turn * found->ray;
      const Eigen::Vector3d aside = (view.frame_from_rig.rotation * base_direction).cross(found->ray) * distance_mm;
      found->slide_mm = aside - found->ray * (found->normal.dot(aside) / found->normal.dot(found->ray));
      found->turn_mm = view.frame_from_rig.rotation * base_direction.cross(found->point_in_rig_mm);
      if (edge.kind == base::EdgeClass::kShadow) {
        ++counts.shadow;
        result.shadows.push_back(*found);
      } else {
        result.rim.push_back(*found);
      }
    }
  }
  return result;
}

double Face::off_mm(const Eigen::Vector3d& point_mm) const {
  const Eigen::Vector3d at = local(point_mm);
  return at.z() - height.dot(monomials(at));
}

Eigen::Vector3d Face::normal_at(const Eigen::Vector3d& point_mm) const {
  const Eigen::Vector3d at = local(point_mm);
  const double by_x = height(1) + 2.0 * height(3) * at.x() + height(4) * at.y();
  const double by_y = height(2) + height(4) * at.x() + 2.0 * height(5) * at.y();
  return axes * Eigen::Vector3d(-by_x, -by_y, 1.0).normalized();
}

Result<Face> find_face(const std::vector<RimCandidate>& candidates, double max_off_mm) {
  constexpr int kRounds = 12;
  constexpr double kWide = 3.0;  // tolerance of the first rounds, in max_off_mm
  constexpr double kMany = 0.4;  // of the fullest height: as many count as a surface
  if (candidates.size() < kLeastCandidates) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("only {} edge pixels in the region end a surface; is the hole in it, and was it scanned?",
                            candidates.size()));
  }
  std::vector<double> x, y, z;
  for (const RimCandidate& c : candidates) {
    x.push_back(c.normal.x());
    y.push_back(c.normal.y());
    z.push_back(c.normal.z());
  }
  const Eigen::Vector3d normal = Eigen::Vector3d(math::median(x), math::median(y), math::median(z)).normalized();
  Face face;
  const Eigen::Vector3d first = normal.unitOrthogonal();
  face.axes << first, normal.cross(first), normal;
  x.clear(), y.clear(), z.clear();
  for (const RimCandidate& c : candidates) {
    x.push_back(c.point_mm.x());
    y.push_back(c.point_mm.y());
    z.push_back(c.point_mm.z());
  }
  face.origin_mm = Eigen::Vector3d(math::median(x), math::median(y), math::median(z));
  // The nearest height at which many lie whose surface looks this way.
  std::vector<double> heights;
  for (const RimCandidate& c : candidates) {
    if (c.normal.dot(normal) > 0.9) heights.push_back(face.local(c.point_mm).z());
  }
  if (heights.size() < kLeastCandidates)
    return fail(ErrorCode::kNoUniqueSolution, "the surfaces beside the edges in the region look to all sides; make it smaller");
  std::sort(heights.begin(), heights.end());
  const double window = kWide * max_off_mm;
  std::vector<std::size_t> within(heights.size());
  std::size_t most = 0;
  for (std::size_t low = 0, high = 0; low < heights.size(); ++low) {
    while (high < heights.size() && heights[high] <= heights[low] + window) ++high;
    within[low] = high - low;
    most = std::max(most, within[low]);
  }
  // Of the windows that hold many the nearest; it begins where its count is largest.
  std::size_t chosen = heights.size() - 1;
  while (static_cast<double>(within[chosen]) < kMany * static_cast<double>(most)) --chosen;
  for (std::size_t i = chosen; i-- > 0 && heights[i] > heights[chosen] - window;) {
    if (within[i] > within[chosen]) chosen = i;
  }
  face.height(0) = 0.5 * (heights[chosen] + heights[chosen + within[chosen] - 1]);
  for (int round = 0; round < kRounds; ++round) {
    const double tolerance = round < kRounds / 2 ? window : max_off_mm;
    Eigen::Matrix<double, 6, 6> normals = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    std::size_t count = 0;
    double reach = 1.0;
    for (const RimCandidate& c : candidates) reach = std::max(reach, face.local(c.point_mm).head<2>().norm());
    for (const RimCandidate& c : candidates) {
      const double off = face.off_mm(c.point_mm) / tolerance;
      if (std::abs(off) > 1.0 || c.normal.dot(normal) < 0.8) continue;
      const double weight = std::pow(1.0 - off * off, 2);
      const Eigen::Vector3d at = face.local(c.point_mm);
      const Eigen::Matrix<double, 6, 1> row = monomials(at);
      normals += weight * row * row.transpose();
      right += weight * at.z() * row;
      ++count;
    }
    if (count < kLeastCandidates) return fail(ErrorCode::kNoUniqueSolution, "no face about the hole was found");
    // A rim says little of curvatures: they are held, as loosely as its heights are, to radii above twice its own extent.
    const double hold = 4.0 * reach * max_off_mm;
    for (const Eigen::Index j : {3, 4, 5}) normals(j, j) += hold * hold;
    face.height = normals.ldlt().solve(right);
  }
  return face;
}

}  // namespace crosstie::edge::detail
