#pragma once

#include <span>
#include <vector>

#include "base/result.h"
#include "verify/compare.h"
#include "verify/detail/partners.h"

namespace crosstie::verify::detail {

/// Looks for what commonly goes wrong between two lists, before anything is fitted to all of their points: units that differ,
/// a mirrored frame, permuted axes, single gross points, ids that do not correspond. What makes a comparison pointless is an
/// Error, what the user should look at a warning. Works on a robust fit (least median of squares over sampled triples,
/// Rousseeuw 1984), so that a gross point does not hide itself or the other causes.
base::Result<std::vector<base::Warning>> check_plausibility(const Partners& partners, Fit fit);

}  // namespace crosstie::verify::detail
