#pragma once

#include <vector>

#include "base/phase_map.h"

namespace crosstie::scan::detail {

/// What a camera's blur does to phases where brightness changes.
///
/// A pixel sees sum K(s - p) a(s) exp(i phi(s)) of its neighbourhood: K its point spread (pixel area included), a what the surface throws
/// back, phi the phase, linear nearby. Brighter places count more, so that the phase is that of a place off the pixel's centre. For a
/// Gaussian K of variance v px^2 in each direction this is exact to first order in the phase's change:
///
///     phase = phi(p) + v grad(phi) . grad(ln B) + v / 2 laplace(phi),   B = sum K a the modulation there,
///
/// for any a where phi is a plane (the last term is of its bending, by perspective and by the surface itself): paint, markers, and the rim, beyond which a = 0 (where what lies behind is dark). v is told by the data: both sides less
/// their means over the neighbourhood, where surfaces are smooth, in proportion.
struct BlurShift {
  double variance_px2 = 0.0;  ///< v; 0 where it was not told
  double sigma_px2 = 0.0;     ///< of v
};

/// Finds v from the planes of one camera and takes the shift out of their turns. Nothing happens where v is not told apart from 0 (5 sigmas)
/// or is no blur of a camera (beyond kLargestVariance_px2).
BlurShift correct_blur_shift(base::PhaseMap& map, int threads);

inline constexpr double kLargestVariance_px2 = 4.0;

}  // namespace crosstie::scan::detail
