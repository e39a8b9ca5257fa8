#pragma once

#include <span>
#include <vector>

#include "edge/detail/rim_fusion.h"
#include "edge/hole_edge.h"

namespace crosstie::edge::detail {

/// Normals of the cells from wide surfaces, where these are known, else of their edge pixels' own; the length of rim that they span, its median.
double turn_normals(std::vector<FusedCell>& cells, std::span<const StationView> stations, const HoleEdgeOptions& options);

}  // namespace crosstie::edge::detail
