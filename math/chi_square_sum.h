#pragma once

#include <array>

namespace crosstie::math {

/// Probability that sum l_i z_i^2 with independent standard normal z_i exceeds x, from c_k = sum l_i^k, k = 1, 2, 3: a chi-square
/// variable with the same mean, variance and skewness (Pearson's three moments; J. P. Imhof, Biometrika 48, 1961, section 4). Exact for
/// equal l_i; for others within 0.01 from 0.5 down to 0.01, and below that too small by up to a sixth (0.001) or a third (1e-4).
/// Not a number for moments that are not positive.
[[nodiscard]] double chi_square_sum_above(double x, const std::array<double, 3>& moments);
/// The x that is exceeded with probability p, of the same approximation.
[[nodiscard]] double chi_square_sum_limit(double p, const std::array<double, 3>& moments);

}  // namespace crosstie::math
