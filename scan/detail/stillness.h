#pragma once

#include <vector>

#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/phase_map.h"
#include "base/result.h"

namespace crosstie::scan::detail {

/// What of a capture is compared at its end: the first and the last image of each pattern that was shown twice.
struct Repeated {
  base::Pattern pattern;
  base::Image first;
  base::Image last;
};

/// Fills the parts of `stillness` that these tell; `limit_px` is what `moved_share` is counted by.
base::Result<> compare_repeated(const std::vector<Repeated>& repeated, const base::GreyNoise& noise, double limit_px,
                                int threads, base::Stillness& stillness);

/// kBadInput that says what moved or changed, by how much and what the limit is; a limit of 0 is none.
base::Result<> judge_stillness(const base::Stillness& stillness, double max_movement_px, double max_light_change);

}  // namespace crosstie::scan::detail
