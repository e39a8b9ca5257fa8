#pragma once

#include <Eigen/Core>

#include "markers/detail/tag_edges.h"

namespace crosstie::markers::detail {

/// The mean tone that a Gaussian of `blur_px` sees of the whole tag at a pixel: the sum of the cells' tones times their shares
/// along both axes of the tag (exact for straight edges; what lies round a corner of a tilted cell only to first order). The
/// outermost cells reach outwards without end.
[[nodiscard]] double blurred_tone(const TagPattern& pattern, const TagFrame& frame, double blur_px,
                                  const Eigen::Vector2d& pixel);

}  // namespace crosstie::markers::detail
