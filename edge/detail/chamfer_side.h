#pragma once

#include <cstddef>
#include <vector>

#include "edge/detail/rim_candidates.h"
#include "edge/detail/rim_line.h"

namespace crosstie::edge::detail {

/// An image shows both sides of a chamfer or lip, or only the one that stands out. Where that is the far one, a few edges begin at the near side and have
/// a band, and the others lie at the far one: a rim that followed both would jump by the chamfer's width. So one side is taken over the whole
/// rim: the near one, where the face ends, unless edges that show the far side alone are more. Then edges with a band whose far side
/// lies on the line of those that their camera saw without one are moved to it. Edges with a band whose near side lies there stay:
/// what follows them is no chamfer. Returns how many were moved.
std::size_t take_one_side(const RimCells& cells, std::vector<RimCandidate>& rim);

}  // namespace crosstie::edge::detail
