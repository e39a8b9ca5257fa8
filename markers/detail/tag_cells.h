#pragma once

#include "markers/detail/sampler.h"
#include "markers/detail/tag_edges.h"

namespace crosstie::markers::detail {

/// What the cells of a tag show, normalised with planes through the black and the white cells of the border.
struct TagReading {
  double margin = -1.0;  ///< of the worst cell with a bit: 1 as black or white as the border, 0 at the decision level, negative
                         ///< where it shows the other tone
  double border_margin = -1.0;  ///< the same of the border's own cells
  double contrast = 0.0;        ///< of the border's white and black in the middle of the tag, in grey levels
  bool cut = false;             ///< the tag reaches beyond the image
};

[[nodiscard]] TagReading read_cells(const Sampler& image, const TagPattern& pattern, const TagFrame& frame);

}  // namespace crosstie::markers::detail
