#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/observation.h"
#include "base/pose.h"

namespace crosstie::math {

/// How a circle of an object appears in one image.
struct CircleView {
  base::LensModel lens = base::LensModel::kPinhole;
  const double* parameters = nullptr;  ///< of the lens
  base::Pose camera_from_object;
  /// [px^2] Of its ellipse, S = R diag(a^2, b^2) R' with the semi-axes a, b: the points e of the outline obey e' S^-1 e = 1.
  Eigen::Matrix2d shape_px2 = Eigen::Matrix2d::Zero();
};

/// The ellipse of an observation as CircleView::shape_px2; zero where its axes are not known.
Eigen::Matrix2d shape_of(const base::Observation& observation);

/// From the image of the circle's centre to the centre of its ellipse, where `circle` is M = r^2 (I - n n') in the object's frame;
/// nothing where it is not seen. Exact for a pinhole: the dual conic of the image is X X' - M in the camera's frame (Hartley &
/// Zisserman, Multiple View Geometry, 2nd ed., ch. 8.2).
std::optional<Eigen::Vector2d> eccentricity_px(const CircleView& view, const Eigen::Vector3d& point,
                                               const Eigen::Matrix3d& circle);

/// The circle M = r^2 (I - n n') about a known point that appears as these ellipses, from one or two images, which do not determine the six
/// numbers of M by themselves: its normal is searched for among those that face the first camera, its radius
/// follows linearly. One image is shown alike by two normals; then one of them is returned. Nothing where no circle explains the ellipses to
/// 15 %.
std::optional<Eigen::Matrix3d> circle_of_pair(std::span<const CircleView> views, const Eigen::Vector3d& point);

}  // namespace crosstie::math
