#pragma once

#include <cstdint>

#include "markers/detail/dot_fit.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

/// What stands around a dot. Values are normalised: 0 = the level of the gap in that direction, 1 = that of the dot.
struct RingReading {
  std::uint64_t ring = 0;     ///< the segments clockwise from an arbitrary one, first in the most significant bit
  double first_rad = 0.0;     ///< where that segment begins on the unit circle of the dot's ellipse
  double margin = 0.0;        ///< of the worst segment: 0 at the decision level, 1 at the mean of its class
  double contrast = 0.0;      ///< between the segments read as 1 and those read as 0
  double grid_quality = 0.0;  ///< 1: all transitions lie on the grid of segments; near 0: they lie anywhere
  double range = 0.0;         ///< largest minus smallest value round the ring
  double bright_gap = 0.0;    ///< fraction of the gap's circumference that is not darker than the middle between dot and gap
  double bright_quiet = 0.0;  ///< the same of the quiet zone
  // Both only of rings that are codes.
  double misfit = 0.0;  ///< largest mean deviation of a part of a segment from what code and blur predict, over the contrast
  double segment_misfit = 0.0;  ///< the same of whole segments from the fit of the whole marker; 0 where there was none
  bool hidden = false;  ///< something seems to lie over a segment: the border beyond a 0 is missing, a 1 has no quiet zone
  bool cut = false;     ///< the ring reaches beyond the image
};

/// Samples gap, ring, quiet zone and border in the affine frame of the dot's ellipse. Levels count from the gap's in that
/// direction, carried outwards on the plane through what is dark of gap and quiet zone: light that changes over the marker by
/// more than its contrast is no obstacle. The phase of the segments follows from the transitions between them: the argument of
/// sum |df/dphi|^2 exp(i bits phi).
///
/// A thing that lies over part of a ring cuts segments along a line of its own: each third of a segment, its inner and its outer
/// half apart, is compared with what the code that was read would look like through the blur. Where the family has a border, that
/// shows what is hidden from outside.
RingReading read_ring(const Sampler& image, const MarkerFamily& family, const DotFit& dot);

}  // namespace crosstie::markers::detail
