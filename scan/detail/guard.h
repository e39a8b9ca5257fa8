#pragma once

#include <vector>

#include "base/phase_map.h"

namespace crosstie::scan::detail {

/// Change of a plane's coordinate from one pixel to the next.
struct PlaneSlope {
  double median = 0.0;  ///< of the absolute changes along the rows and columns, whichever is larger [turns/px]
};
PlaneSlope slope_of(const base::PhasePlane& plane, int width, int height);

/// Of each pixel: whether it has coordinates and lies at least `guard_px` from the nearest end of the surface: from pixels without
/// coordinates, those aside whose phases are hardly worse than what is taken (light that fades is no end), and from jumps, where
/// neighbours differ by more than surfaces that a camera sees do (4 median slopes and 6 sigmas).
std::vector<char> guarded_pixels(const base::PhaseMap& map, int guard_px);

}  // namespace crosstie::scan::detail
