#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "markers/detail/dot_kernel.h"
#include "markers/detail/small_cholesky.h"

namespace crosstie::markers::detail {

/// What the harmonics 3..5 of an edge say.
struct EdgeHarmonics {
  double power = 0.0;      ///< over what the pixels' noise explains
  double amplitude = 0.0;  ///< of the largest, in the columns' unit of length
};

/// From normal equations whose last kEdgeHarmonics unknowns are the harmonics' cosines and sines, N = L D L' and the right side b:
/// with y = L^-1 b the amplitudes are L_hh'^-1 D_h^-1 y_h, and their power y_h' D_h^-1 y_h.
template <std::size_t N>
EdgeHarmonics edge_harmonics(const SmallCholesky<N>& root, const std::array<double, N>& b) {
  constexpr std::size_t kFirst = N - kEdgeHarmonics;
  const auto y = root.forward(b);
  std::array<double, kEdgeHarmonics> amplitudes;
  EdgeHarmonics result;
  for (std::size_t k = kEdgeHarmonics; k-- > 0;) {
    const std::size_t row = kFirst + k;
    amplitudes[k] = y[row] / root.pivot(row);
    result.power += y[row] * amplitudes[k] / kEdgeHarmonics;
    for (std::size_t i = k + 1; i < kEdgeHarmonics; ++i) amplitudes[k] -= root.factor(kFirst + i, row) * amplitudes[i];
  }
  for (std::size_t h = 0; h < kEdgeHarmonics; h += 2) {
    result.amplitude = std::max(result.amplitude, std::hypot(amplitudes[h], amplitudes[h + 1]));
  }
  return result;
}

}  // namespace crosstie::markers::detail
