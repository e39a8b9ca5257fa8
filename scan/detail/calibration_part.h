#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "scan/match.h"

namespace crosstie::scan::detail {

/// Covariance of a point of the left camera's frame that the head's calibration leaves, where its pixels in both images are given:
/// J cov J', J by differences over the lenses' parameters and right_from_left. Zero where the head has no covariance.
Eigen::Matrix3d calibration_covariance(const base::Head& head, const Eigen::Vector3d& point_mm);

/// The largest axis (1 sigma) of that covariance for every pixel with a depth: at places kSpacing px apart, between them in proportion to
/// the square of the depth. Empty where the head has no covariance.
std::vector<float> calibration_sigmas(const base::Head& head, const DepthMap& depths, int threads);

}  // namespace crosstie::scan::detail
