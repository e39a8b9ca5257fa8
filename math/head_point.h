#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/machine.h"

namespace crosstie::math {

/// The point of the left pixel's ray that is nearest to the right one's. It may lie behind the camera.
std::optional<Eigen::Vector3d> point_of_left_ray(const base::Camera& left, const base::Camera& right,
                                                 const base::Pose& right_from_left, const Eigen::Vector2d& left_px,
                                                 const Eigen::Vector2d& right_px);

/// The head with one parameter changed, counted as in Head::cov; nothing where the lens model does not take that value.
std::optional<base::Head> moved_head(const base::Head& head, Eigen::Index parameter, double step);

/// From one state of a head to another of the same lens models, as Head::cov counts its parameters.
[[nodiscard]] Eigen::VectorXd head_change(const base::Head& from, const base::Head& to);

/// Derivative of a point of the left camera's frame, met by the rays of its pixels in both images, by the head's parameters (left lens, right
/// lens, right_from_left [rad, mm], the order of base::Head::cov): 3 x parameter_count, by differences. The pixels are those at which the
/// head as it is sees the point. Columns of parameters without variance are zero; all are where a camera does not see the point or the
/// head has no covariance.
[[nodiscard]] Eigen::Matrix3Xd point_by_head(const base::Head& head, const Eigen::Vector3d& p_in_rig_mm);

}  // namespace crosstie::math
