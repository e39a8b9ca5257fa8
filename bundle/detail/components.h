#pragma once

#include <vector>

#include "base/network.h"
#include "base/result.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/weights.h"

namespace crosstie::bundle::detail {

/// The variance components of an adjustment at its minimum, relative to the sigmas that it was computed with: of the image points of each
/// camera that took part, of the scale bars and of the control points, where there are any (math/variance_components.h). What was known of
/// lenses beforehand counts as stated.
base::Result<std::vector<base::VarianceComponent>> components_of(const Survey& survey, const Estimate& at);

/// Multiplies sigmas by the ratios of their groups and adjusts anew, until no ratio changes any more; the ratios are those to the sigmas
/// before. Moves `state`, `weights`, `plan` and `at`.
base::Result<std::vector<base::VarianceComponent>> apply_components(const Survey& survey, const AdjustOptions& options,
                                                                    Weights& weights, ModelPlan& plan, State& state,
                                                                    base::Result<Estimate>& at, const base::Progress& progress);

/// sigma_ratio: a group whose sigmas are not those that were stated, beyond chance and by more than half.
void about_components(base::AdjustedNetwork& result);

}  // namespace crosstie::bundle::detail
