#include "registration/segment.h"

#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "base/parallel.h"
#include "math/shape_fit.h"

namespace crosstie::registration {
namespace {

using base::Segment;
using Eigen::Vector3d;

constexpr std::size_t kPoints = 400;  // enough for a direction; the fits' time grows with them
constexpr double kFlat = 1e-3;        // rms of a plane over the points' width
constexpr double kMuchBetter = 0.1;   // rms of a round shape over that of the plane
constexpr double kConeSigmas = 5.0;   // half angle over its sigma
constexpr double kConeBetter = 0.9;   // rms of the cone over that of the cylinder

}  // namespace

Segment fit_segment(std::span<const Vector3d> points_mm, int threads) {
  Segment segment;
  std::vector<Vector3d> points;
  const std::size_t every = std::max<std::size_t>(1, points_mm.size() / kPoints);
  for (std::size_t i = 0; i < points_mm.size(); i += every) points.push_back(points_mm[i]);
  if (points.size() < 20) return segment;
  const auto plane = math::fit_plane(points);
  if (!plane) return segment;
  base::Result<math::ShapeFit<math::Cylinder>> cylinder = tl::unexpected(base::Error{});
  base::Result<math::ShapeFit<math::Cone>> cone = tl::unexpected(base::Error{});
  (void)base::parallel_for(2, threads, "shape", {}, [&](std::size_t i) -> base::Result<> {  // where a fit fails, it has failed
    if (i == 0) cone = math::fit_cone(points);
    if (i == 1) cylinder = math::fit_cylinder(points);
    return {};
  });
  const double limit = kMuchBetter * plane->quality.rms_mm;
  const bool conical = cone && cone->quality.rms_mm < limit &&
                       cone->shape.half_angle_rad > kConeSigmas * cone->quality.half_angle_sigma_rad() &&
                       (!cylinder || cone->quality.rms_mm < kConeBetter * cylinder->quality.rms_mm);
  if (conical) {
    segment.kind = Segment::Kind::kCone;
    segment.point_mm = cone->shape.point_mm;
    segment.direction = cone->shape.direction;
    segment.half_angle_rad = cone->shape.half_angle_rad;
    segment.radius_mm = cone->shape.distance_mm / std::cos(cone->shape.half_angle_rad);
    segment.rms_mm = cone->quality.rms_mm;
  } else if (cylinder && cylinder->quality.rms_mm < limit) {
    segment.kind = Segment::Kind::kCylinder;
    segment.point_mm = cylinder->shape.point_mm;
    segment.direction = cylinder->shape.direction;
    segment.radius_mm = cylinder->shape.radius_mm;
    segment.rms_mm = cylinder->quality.rms_mm;
  }
  if (segment.kind != Segment::Kind::kNone) return segment;
  // How wide the points are in the plane, across their length.
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Vector3d& point : points) moments += (point - plane->shape.point_mm) * (point - plane->shape.point_mm).transpose();
  const double width = std::sqrt(12.0 * Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvalues()(1) /
                                 static_cast<double>(points.size()));
  if (plane->quality.rms_mm < kFlat * width) {
    segment.kind = Segment::Kind::kPlane;
    segment.point_mm = plane->shape.point_mm;
    segment.direction = plane->shape.normal;
    segment.rms_mm = plane->quality.rms_mm;
  }
  return segment;
}

}  // namespace crosstie::registration
