#pragma once

#include "base/machine.h"
#include "bundle/commission.h"
#include "bundle/detail/axis_motion.h"
#include "bundle/detail/head_model.h"
#include "math/solution.h"

namespace crosstie::bundle::detail {

/// Everything that is known at the end of a commissioning.
struct HeadResult {
  const CommissionInput& input;
  const CommissionOptions& options;
  const HeadSurvey& survey;
  const SpherePairs& spheres;
  const HeadState& state;
  const HeadModel& head;
  const math::Solution& solution;
  const AxisModel& axis;
  const AxisMotion& motion;
  const StationPoses& free_stations;  ///< before they were told that they stand on one axis
  double image_sigma_factor = 1.0;
  double largest_eccentricity_px = 0.0;
};

/// Puts the result together, with its covariances, tests and warnings.
base::Result<base::Commissioning> head_outcome(const HeadResult& result);

/// Of a marker against its list: adjusted minus given, its covariance as far as it is known, and its standardised length.
struct ListedResidual {
  Eigen::Vector3d residual_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();
  double w = 0.0;
};

/// Of all markers of the cross; zero for those that are not in the model.
base::Result<std::vector<ListedResidual>> listed_residuals(const CommissionInput& input, const HeadState& state,
                                                           const HeadModel& head, const math::Solution& solution);

}  // namespace crosstie::bundle::detail
