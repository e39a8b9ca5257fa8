#include "math/chi_square_sum.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "math/distributions.h"

namespace crosstie::math {
namespace {

std::array<double, 3> moments_of(const std::vector<double>& weights) {
  std::array<double, 3> moments{};
  for (const double l : weights) {
    for (std::size_t k = 0; k < 3; ++k) moments[k] += std::pow(l, static_cast<double>(k + 1));
  }
  return moments;
}

double above(double x, const std::vector<double>& weights) { return chi_square_sum_above(x, moments_of(weights)); }

TEST(ChiSquareSum, OfEqualWeightsIsAChiSquareVariable) {
  EXPECT_NEAR(above(9.2, {2.0, 2.0, 2.0}), 1.0 - chi_square_cdf(4.6, 3), 1e-12);
  EXPECT_NEAR(above(1.0, {1.0}), std::erfc(std::sqrt(0.5)), 1e-12);
}

// Exact by numerical inversion of the characteristic function (Imhof 1961, equation 3.2; his table 1 has 0.1240 for the first).
TEST(ChiSquareSum, IsNearTheExactProbability) {
  EXPECT_NEAR(above(2.0, {0.6, 0.3, 0.1}), 0.123959, 0.003);
  EXPECT_NEAR(above(4.0, {0.6, 0.3, 0.1}), 0.016862, 0.001);
  EXPECT_NEAR(above(6.0, {0.6, 0.3, 0.1}) / 0.002592, 1.0, 0.06);
  EXPECT_NEAR(above(4.0, {0.7, 0.2, 0.05, 0.03, 0.02}) / 0.022397, 1.0, 0.03);
  EXPECT_NEAR(above(2.0 * 2.7, {1.0, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 0.1}) / 0.078845, 1.0, 0.05);
  EXPECT_EQ(above(0.0, {0.6, 0.3, 0.1}), 1.0);
}

TEST(ChiSquareSum, TheLimitIsTheInverse) {
  const auto moments = moments_of({0.6, 0.3, 0.1});
  for (const double p : {0.5, 0.05, 0.001})
    EXPECT_NEAR(chi_square_sum_above(chi_square_sum_limit(p, moments), moments), p, 1e-9);
  EXPECT_TRUE(std::isnan(above(1.0, {})));
  EXPECT_TRUE(std::isnan(chi_square_sum_limit(0.0, moments)));
}

}  // namespace
}  // namespace crosstie::math
