#pragma once

#include "markers/detail/candidates.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

/// Whether a candidate is worth a fit: brighter (darker) inside than in the gap around, which ends at `gap_outer` [dot radii],
/// by at least `min_contrast` grey levels, in nearly all of 16 directions. A few pixels decide; thresholds are wide of what the
/// fit accepts.
[[nodiscard]] bool looks_like_dot(const Sampler& image, const Candidate& candidate, double gap_outer, double min_contrast);

/// Whether nothing around a dot can be a ring: everything out to the middle of a ring is like the ground beside the dot, in twice
/// as many directions as a ring has segments. False where in doubt.
[[nodiscard]] bool stands_alone(const Sampler& image, const Ellipse& ellipse, double inner_level, double outer_level,
                                const MarkerFamily& family);

}  // namespace crosstie::markers::detail
