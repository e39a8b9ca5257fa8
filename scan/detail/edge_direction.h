#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/edge_sites.h"

namespace crosstie::scan::detail {

/// Offset, slope and curvature of a line through places (along, across), robust.
Eigen::Vector3d robust_curve(const std::vector<Eigen::Vector2d>& places);

/// Directions and curvatures from the strongest steps; these again, since a step seen at a slant is blurred. Sites without are left out.
base::Result<> find_directions(Sites& sites, const base::PhaseMap& map, const EdgeImages& images, const EdgeOptions& options,
                               const base::Progress& progress);

}  // namespace crosstie::scan::detail
