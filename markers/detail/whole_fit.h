#pragma once

#include <cstdint>
#include <optional>

#include "markers/detail/dot_fit.h"
#include "markers/detail/ellipse.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

/// A ring whose code is known, and where it was read.
struct ReadRing {
  Ellipse dot;             ///< in whose affine frame it was read
  double first_rad = 0.0;  ///< where the first segment begins on the unit circle of that frame, clockwise in the image
  std::uint64_t ring = 0;  ///< as in RingReading
};

/// A dot, and what its ring says of the code that was assumed.
struct WholeFit {
  DotFit dot;
  double misfit =
      0.0;  ///< largest mean deviation of a segment from the model, over the ring's contrast; 0.5 or so where it is wrong
};

/// The blurred dot fitted together with the ring around it, for markers whose blur mixes the light of both.
///
/// Model: with D and R the cover of dot and ring (segments that are 1, border) through the same Gaussian (cover_image.h),
///     grey(p) = O(e) + (I(e) - O(e)) D(p) + (W(e) - O(e)) R(p),
/// I, O, W the levels of dot, ground and ring, linear in e = p - c; the slopes of all three follow the light's. D is that of any
/// ellipse. R is the known code in a projective frame of its own, with eight free parameters: where the ring was printed, how large,
/// and how perspective displaces it from the dot's ellipse moves the dot's centre no more than the ring's noise does. Parameters:
/// 12 of the dot as in dot_fit.h, 8 of the ring's frame, 3 of its level. All pixels out to the ring's outer edge, weighted, and
/// with the harmonics of the dot's edge, as there; the covariance is the dot's within the whole adjustment.
///
/// Nothing where the marker leaves the image or the adjustment does not converge.
std::optional<WholeFit> fit_whole_marker(const Sampler& image, const DotFit& earlier, const ReadRing& ring,
                                         const MarkerFamily& family, const DotFitOptions& options);

}  // namespace crosstie::markers::detail
