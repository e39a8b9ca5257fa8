#pragma once

#include <vector>

#include "base/phase_map.h"
#include "scan/detail/fringe_set.h"

namespace crosstie::scan::detail {

/// Light that is no cosine moves a phase of N even steps by an error that repeats N times a fringe. Over whole fringes every phase is
/// equally likely, so that the error e shows as the density p of the measured phases: de/dx = p - 1, at the harmonics N and 2 N. Lines
/// of the image between two places where the phase begins anew are whole fringes. Takes e out of `set.turns` where its amplitude is told
/// apart from chance, and returns that amplitude [turns].
double correct_ripple(const std::vector<base::PhaseStatus>& status, int width, int height, FringeSet& set, int threads);

}  // namespace crosstie::scan::detail
