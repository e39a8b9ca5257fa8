#pragma once

#include <vector>

#include "markers/detail/ellipse.h"

namespace crosstie::markers::detail {

struct PixelSet;

/// Light of the ring that the blur spreads into the gap, known once the ring has been sampled: the grey levels
///     contrast f(phi) Phi((rho - inner_rho) / (|grad rho| blur)),  phi and rho in the affine frame of `ellipse`.
struct RingLight {
  Ellipse ellipse;
  double blur_px = 0.0;
  double contrast = 0.0;
  double inner_rho = 0.0;
  std::vector<double> profile;  ///< f: 0 as dark as the gap, 1 as bright as the dot; equidistant round the ring

  /// Takes the light off the grey levels of the pixels.
  void take_off(PixelSet& pixels) const;
};

}  // namespace crosstie::markers::detail
