#pragma once

#include "base/network.h"
#include "bundle/detail/estimate.h"

namespace crosstie::bundle::detail {

/// Figures about an adjusted network that reports show; each fills in its own fields.
void count_observations(const Estimate& at, base::AdjustedNetwork& result);
void count_unknowns(const Estimate& at, base::AdjustedNetwork& result);
/// Of the images and of the cameras, from result.residuals.
void add_coverage(base::AdjustedNetwork& result);
/// AdjustedCamera::significance_p, from the covariances and the redundancy.
void add_significance(const Estimate& at, base::AdjustedNetwork& result);

}  // namespace crosstie::bundle::detail
