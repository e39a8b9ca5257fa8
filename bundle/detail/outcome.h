#pragma once

#include "base/network.h"
#include "base/result.h"
#include "bundle/adjust.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/outliers.h"
#include "bundle/detail/weights.h"

namespace crosstie::bundle::detail {

/// The adjusted network as others see it: covariances in the datum of frame.h times sigma0^2, residuals with their tests,
/// what was rejected and why. Warnings are added by diagnose().
base::Result<base::AdjustedNetwork> make_outcome(const Survey& survey, const AdjustOptions& options, const State& state,
                                                 const Estimate& at, const Weights& weights, const Reasons& reasons);

/// Warnings about what weakens the network; what its parts look at stands in diagnose.h. Besides: few rays, small angles, one
/// bar, contradicting bars and control points, uncontrolled observations, moved points, images left out, an a priori sigma that
/// the residuals contradict.
void diagnose(const Survey& survey, const State& state, const Weights& weights, base::AdjustedNetwork& result);

}  // namespace crosstie::bundle::detail
