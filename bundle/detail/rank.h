#pragma once

#include "math/parameters.h"
#include "math/whitened_rows.h"

namespace crosstie::bundle::detail {

/// Structural rank of a design matrix: the rank of a matrix with this pattern of zeros and otherwise arbitrary entries, which
/// is how many unknowns can be given an observation each that depends on them (a maximum matching, as Matlab's sprank; blocks
/// count as dense). Below the number of unknowns something is observed too seldom, whatever the geometry. A datum defect does
/// not show in it.
[[nodiscard]] int structural_rank(const math::WhitenedRows& rows, const math::Parameters& parameters);

}  // namespace crosstie::bundle::detail
