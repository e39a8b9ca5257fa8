#pragma once

#include <vector>

#include "base/phase_map.h"

namespace crosstie::scan::detail {

/// Median of the absolute changes from one pixel to the next, along the rows or the columns, whichever is larger [turns/px].
double median_slope(const base::PhasePlane& plane, int width, int height);

/// Of each pixel: whether it has coordinates and lies at least `guard_px` from the nearest end of the surface: from pixels without
/// coordinates, those aside whose phases are hardly worse than what is taken (light that fades is no end), and from jumps, where
/// neighbours differ by more than surfaces that a camera sees do (4 median slopes and 6 sigmas), and with `creases` from those, where the slope changes
/// within a few pixels (by 0.1 median slopes and 5 sigmas): a pixel there sees both sides, such as the face and the cut of a hole.
std::vector<char> guarded_pixels(const base::PhaseMap& map, int guard_px, bool creases, int threads);

}  // namespace crosstie::scan::detail
