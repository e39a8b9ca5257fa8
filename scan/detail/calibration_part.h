#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "scan/match.h"

namespace crosstie::scan::detail {

/// The point of the left pixel's ray that is nearest to the right one's. It may lie behind the camera.
std::optional<Eigen::Vector3d> point_of_left_ray(const base::Camera& left, const base::Camera& right,
                                                 const base::Pose& right_from_left, const Eigen::Vector2d& left_px,
                                                 const Eigen::Vector2d& right_px);

/// The head with one parameter changed, counted as in Head::cov; nothing where the lens model does not take that value.
std::optional<base::Head> moved_head(const base::Head& head, Eigen::Index parameter, double step);

/// Covariance of a point of the left camera's frame that the head's calibration leaves, where its pixels in both images are given:
/// J cov J', J by differences over the lenses' parameters and right_from_left. Zero where the head has no covariance.
Eigen::Matrix3d calibration_covariance(const base::Head& head, const Eigen::Vector3d& point_mm);

/// The largest axis (1 sigma) of that covariance for every pixel with a depth: at places kSpacing px apart, between them in proportion to
/// the square of the depth. Empty where the head has no covariance.
std::vector<float> calibration_sigmas(const base::Head& head, const DepthMap& depths);

}  // namespace crosstie::scan::detail
