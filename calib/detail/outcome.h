#pragma once

#include "base/calibration.h"
#include "base/result.h"
#include "calib/detail/estimate.h"

namespace crosstie::calib::detail {

/// The result nouns from the minimum; warnings of the problem go along.
base::Result<base::Calibration> make_outcome(const Problem& problem, const State& state, const Estimate& at);

/// Distance of the projection centres and its sigma, from the mount and its covariance.
struct Baseline {
  double mm = 0.0;
  double sigma_mm = 0.0;
};
Baseline baseline_of(const base::Pose& right_from_left, const base::Matrix6d& cov);

}  // namespace crosstie::calib::detail
