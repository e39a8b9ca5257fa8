#pragma once

#include <vector>

#include "base/verification.h"
#include "verify/compare.h"
#include "verify/detail/partners.h"

namespace crosstie::verify::detail {

/// The distances between the used partners, those that define the scale aside: all of them, or an even selection over their
/// lengths of `options.max_lengths`. Sorted by nominal length. `scale` multiplies the measured lengths (1 unless fitted).
std::vector<base::LengthDeviation> test_lengths(const Partners& partners, double scale, const CompareOptions& options);

}  // namespace crosstie::verify::detail
