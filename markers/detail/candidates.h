#pragma once

#include <vector>

#include "base/image.h"
#include "markers/detail/ellipse.h"
#include "markers/detect.h"

namespace crosstie::markers::detail {

/// What may be a dot: an ellipse good to about a pixel (of the level of the pyramid in which it was found), and whether it is
/// brighter than its surroundings.
struct Candidate {
  Ellipse ellipse;
  bool bright = true;
  double scale = 1.0;  ///< size of the pixels of that level [px]
};

/// Regions that are brighter (darker) than the mean of their neighbourhood and filled like an ellipse: their area is that of the
/// ellipse with their moments. The neighbourhood is a window of kMeanWindowPx, larger than dot and gap up to a radius of about a
/// third of it; larger dots are found in images reduced by 2, 4, 8 ... The largest candidates come first.
std::vector<Candidate> find_candidates(const base::ImageView& image, const DetectOptions& options);

}  // namespace crosstie::markers::detail
