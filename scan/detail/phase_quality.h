#pragma once

#include <cstdint>
#include <vector>

#include "base/phase_map.h"
#include "scan/decode.h"
#include "scan/detail/fringe_set.h"

namespace crosstie::scan::detail {

/// The phases of a set with their sigmas, and how the residuals of those that are taken compare with the noise.
struct PhaseQuality {
  base::Plane<float> sigma_turns;  ///< sqrt(gain var(level)) / (2 pi B)
  double squares = 0.0;            ///< sum of the squared residuals over what is expected
  std::int64_t tested = 0;         ///< pixels with degrees of freedom
  std::int64_t disturbed = 0;      ///< of these
  std::int64_t valid = 0;          ///< pixels that are kValid now
};

/// Of each pixel. Where its neighbours agree with its B, theirs and its own are averaged for it: near the least modulation that is
/// taken, those whose noise made B larger would be taken, with a sigma that is too small. Takes the memory of `set.squares`. Changes `status` from kValid to kDark,
/// kSaturated or kDisturbed where options ask for it; `waveform` as of ResidualStatistics.
PhaseQuality judge_phases(FringeSet& set, const base::GreyNoise& noise, double waveform, const DecodeOptions& options,
                          int width, int height, std::vector<base::PhaseStatus>& status);

}  // namespace crosstie::scan::detail
