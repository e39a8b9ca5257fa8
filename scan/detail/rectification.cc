#include "scan/detail/rectification.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace crosstie::scan::detail {
namespace {

/// Y/Z of a pixel's ray in the rectified frame.
std::optional<double> row_of(const base::Camera& camera, const Eigen::Matrix3d& rectified_from_camera,
                             const Eigen::Vector2d& pixel) {
  const auto ray = camera.unproject(pixel);
  if (!ray) return {};
  const Eigen::Vector3d direction = rectified_from_camera * *ray;
  if (!(direction.z() > 0.0)) return {};
  return direction.y() / direction.z();
}

/// Its derivatives by the pixel.
std::optional<Eigen::RowVector2d> row_slope(const base::Camera& camera, const Eigen::Matrix3d& rectified_from_camera,
                                            const Eigen::Vector2d& pixel) {
  constexpr double kStep_px = 0.5;
  Eigen::RowVector2d slope;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep_px * Eigen::Vector2d::Unit(axis);
    const auto above = row_of(camera, rectified_from_camera, pixel + step);
    const auto below = row_of(camera, rectified_from_camera, pixel - step);
    if (!above || !below) return {};
    slope(axis) = (*above - *below) / (2.0 * kStep_px);
  }
  return slope;
}

}  // namespace

base::Result<Rectification> rectify(const base::Pose& right_from_left) {
  const base::Pose left_from_right = right_from_left.inverse();
  Rectification result;
  result.baseline_mm = left_from_right.translation_mm.norm();
  const Eigen::Vector3d x = left_from_right.translation_mm / std::max(result.baseline_mm, 1e-300);
  const Eigen::Vector3d forward = Eigen::Vector3d::UnitZ() + left_from_right.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d y = forward.cross(x);
  if (!(result.baseline_mm > 1e-6) || !(y.norm() > 0.1)) {
    return base::fail(base::ErrorCode::kBadInput,
                      "the cameras of the head do not look across their baseline side by side; is the rig's pose right?");
  }
  result.rectified_from_left.row(0) = x;
  result.rectified_from_left.row(1) = y.normalized();
  result.rectified_from_left.row(2) = x.cross(y.normalized());
  result.rectified_from_right = result.rectified_from_left * left_from_right.rotation.toRotationMatrix();
  return result;
}

std::optional<double> off_curve_px(const base::Head& head, const Rectification& frame, const Eigen::Vector2d& left_px,
                                   const Eigen::Vector2d& right_px) {
  const auto left = row_of(head.left, frame.rectified_from_left, left_px);
  const auto right = row_of(head.right, frame.rectified_from_right, right_px);
  if (!left || !right) return {};
  return head.right.focal_px().mean() * (*right - *left);
}

std::optional<OffCurve> off_curve(const base::Head& head, const Rectification& frame, const Eigen::Vector2d& left_px,
                                  const Eigen::Matrix2d& left_cov_px2, const Eigen::Vector2d& right_px,
                                  const Eigen::Matrix2d& right_cov_px2) {
  const auto distance_px = off_curve_px(head, frame, left_px, right_px);
  const auto left_slope = row_slope(head.left, frame.rectified_from_left, left_px);
  const auto right_slope = row_slope(head.right, frame.rectified_from_right, right_px);
  if (!distance_px || !left_slope || !right_slope) return {};
  const double focal_px = head.right.focal_px().mean();
  const double variance =
      (*left_slope * left_cov_px2 * left_slope->transpose())(0) + (*right_slope * right_cov_px2 * right_slope->transpose())(0);
  return OffCurve{*distance_px, focal_px * std::sqrt(variance)};
}

}  // namespace crosstie::scan::detail
