#pragma once

#include <vector>

#include "base/stitching.h"
#include "registration/detail/outcome.h"

namespace crosstie::registration::detail {

/// From the station at one end of the row to each of the others, in their order along it: how well the second's place is known as the first
/// sees it, and how well it would be if markers and overlaps alone joined them. Not a number where these do not join them.
std::vector<base::StitchDrift> find_drift(const StitchWork& work, StitchSolution& solution, const base::Stitching& result);

}  // namespace crosstie::registration::detail
