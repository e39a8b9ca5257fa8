#pragma once

#include <cstdint>

namespace crosstie::study {

/// The machine's frame of the same worlds with image points that are drawn instead of found in photographs: prints the mean squares over
/// their degrees of freedom, so that what the images add can be told from what the adjustment does.
int sampled_frames(std::uint64_t first, std::uint64_t last);

}  // namespace crosstie::study
