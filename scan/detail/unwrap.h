#pragma once

#include <cstdint>
#include <vector>

#include "base/pattern_sequence.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/fringe_set.h"
#include "scan/detail/gray_code.h"

namespace crosstie::scan::detail {

/// Fringe told by the Gray code: the coordinate t = k + phase whose k brings it nearest to its word's middle. Where the word does not
/// tell (two bits doubtful, or the phase half a period off), the neighbours do, where they agree: a surface is continuous over a few
/// pixels. What no one tells becomes kUndecided. `words.doubtful` is used up. `status` must hold kValid or a reason for every pixel. Fills plane.turns.
base::Result<> unwrap_by_gray_code(GrayWords& words, const FringeSet& fringes, double word_periods, double word_offset,
                                   int width, int height, int threads, base::PhasePlane& plane,
                                   std::vector<base::PhaseStatus>& status, const base::Progress& progress);

/// Fringe told by several sets with different numbers of fringes: of all coordinates that the finest phase allows the one at which
/// the sum of squares of the other phases' differences over their sigmas is least, fused with them. kUndecided where the second best
/// is less than 3 sigmas worse, or the best is worse than chance (1 in 10^5). `sigmas_turns[i]` of set i's phases.
/// (Maximum likelihood; the idea of Lilienblum and Michaelis, J. Computers and Physics 2(2), 2007.) Fills turns and sigma_turns.
base::Result<> unwrap_by_sets(const std::vector<const FringeSet*>& sets, const std::vector<base::Plane<float>>& sigmas_turns,
                              const base::AxisCode& code, int width, int height, int threads, base::PhasePlane& plane,
                              std::vector<base::PhaseStatus>& status, const base::Progress& progress);

}  // namespace crosstie::scan::detail
