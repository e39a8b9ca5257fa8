#pragma once

#include <optional>
#include <vector>

#include "markers/detail/ellipse.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

struct DotFit;
struct PixelSet;

/// Light of the ring that the blur spreads into the gap: the grey levels
///     contrast f(phi) [Phi((rho - inner) / s) - Phi((rho - outer) / s)],    s = |grad rho| blur,
/// phi and rho in the affine frame of the dot's ellipse. f, blurred along the ring by the image itself, is sampled in the middle
/// of the ring's width, where the bracket is known, too.
class RingLight {
 public:
  /// Nothing where the ring leaves the image or is saturated [grey levels]: its light is then not known.
  static std::optional<RingLight> of(const Sampler& image, const DotFit& dot, const MarkerFamily& family,
                                     double saturated_level);

  /// Takes the light off the grey levels of the pixels.
  void take_off(PixelSet& pixels) const;

 private:
  [[nodiscard]] double bracket(double rho, double gradient) const;

  Ellipse ellipse_;
  double blur_px_ = 0.0;
  double contrast_ = 0.0;
  double inner_rho_ = 0.0;
  double outer_rho_ = 0.0;
  std::vector<double> profile_;  ///< f at equidistant phi from the major axis on
};

}  // namespace crosstie::markers::detail
