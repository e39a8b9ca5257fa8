#pragma once

#include <vector>

#include "base/machine.h"
#include "scan/match.h"

namespace crosstie::scan {

/// The left camera's depths as the right camera sees them: of each of its pixels the nearest point that falls there, holes of one pixel filled.
std::vector<float> right_depths(const DepthMap& depths, const base::Head& head);

}  // namespace crosstie::scan
