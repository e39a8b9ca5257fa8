#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calib/calibrate.h"
#include "calib/detail/estimate.h"

namespace crosstie::calib::detail {

/// Standardised residual of each corner, sqrt(v' Qvv^-1 v / 2) over the a priori sigma; of one that takes no part the distance over
/// sqrt(2) sigmas; infinite where its view has no pose.
std::vector<double> standardised(const Problem& problem, const State& state, const Estimate& at);

/// Least squares and data snooping in turn until nothing changes; what fits after all is taken back at the end. The level is that
/// of all corners together: the probability that any correct one leaves. A view of which a third or more would leave, leaves as a whole.
base::Result<Estimate> estimate_without_outliers(const Problem& problem, const CalibrateOptions& options, State& state,
                                                 const base::Progress& progress);

}  // namespace crosstie::calib::detail
