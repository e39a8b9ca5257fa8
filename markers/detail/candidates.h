#pragma once

#include <vector>

#include "base/image.h"
#include "markers/detail/ellipse.h"
#include "markers/detect.h"

namespace crosstie::markers::detail {

/// What may be a dot: an ellipse good to about a pixel, and whether it is brighter than its surroundings.
struct Candidate {
  Ellipse ellipse;
  bool bright = true;
};

/// Regions that are brighter (darker) than the mean of their neighbourhood and whose outline is an ellipse.
/// The neighbourhood is a fixed window: inside of larger dots the comparison says nothing, but their outlines stay closed
/// bands.
std::vector<Candidate> find_candidates(const base::ImageView& image, const DetectOptions& options);

}  // namespace crosstie::markers::detail
