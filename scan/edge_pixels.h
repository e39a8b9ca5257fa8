#pragma once

#include <vector>

#include "base/edge_pixels.h"
#include "base/image.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::scan {

struct EdgeOptions {
  /// Half the length of the piece of edge from which one position is found [px]: longer pieces average more grain of the surface, and
  /// round off corners.
  double half_piece_px = 5.0;
  /// How far to either side of the edge levels are looked at [px].
  double reach_px = 7.0;
  /// Least height of the first step over the sigma that grain and noise leave of it.
  double min_step_sigmas = 5.0;
  /// Paint is reported from a step of this share of the brighter side on; fainter ones are grain.
  double min_paint_step = 0.25;
  int threads = 0;  ///< 0: as many as the machine has; no effect on the outcome

  [[nodiscard]] base::Result<> validate() const;
};

/// What is known of one camera's view.
struct EdgeInput {
  const base::PhaseMap* phases = nullptr;
  const base::Image* white = nullptr;  ///< photograph under full light; null: none, as with some captures
  const std::vector<float>* depth_mm =
      nullptr;  ///< z of each pixel in this camera's frame, not a number where unknown; null: none
};

/// Sub-pixel edges of one camera's image.
///
/// Where: at the ends and bends of the surfaces that the phases show (detail/surface_end.h); paint at strong maxima of the gradient where phases
/// go on; such a maximum is material where they end or leave their course directly beyond. The direction is first that of the end or of the
/// image's gradient, across whichever the step stands out more. How: levels that step one to three times, blurred by the camera's point
/// spread, fitted to all edge images together: the mean of the fringe images, their modulation, the white image
/// (detail/step_profile.h); over a piece of edge whose direction and curvature its neighbours
/// tell, its number of steps decided with them. The position is that of the step next to the material: where the face ends, not the
/// far side of a chamfer. The point spread is the camera's, found at the sharpest clean steps of the image.
/// Sigma: of the fit; grain of the surface counts as correlated over the point spread; larger where the edge images disagree.
/// Class: phases before the edge are continued beyond it. They go on: paint. They end, and across the dark follows nearer material: shadow.
/// Else material. Of two surfaces at a jump the nearer one has the edge.
/// Errors: options; kBadInput where sizes differ.
base::Result<base::EdgePixels> find_edges(const EdgeInput& input, const EdgeOptions& options,
                                          const base::Progress& progress = {});

}  // namespace crosstie::scan
