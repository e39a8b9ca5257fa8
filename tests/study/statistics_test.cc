// The study's statistics: against tables of the chi-square distribution and against seeds that are drawn as the study's claims have them.

#include "tests/study/statistics.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace crosstie::study {
namespace {

/// Squares of `seeds` seeds of `dof` degrees of freedom whose errors are `factor` times what their sigmas say.
std::vector<Square> drawn(int seeds, int dof, double factor, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  std::vector<Square> squares;
  for (int i = 0; i < seeds; ++i) {
    Square one{0.0, static_cast<double>(dof)};
    for (int k = 0; k < dof; ++k) one.square += std::pow(factor * normal(engine), 2);
    squares.push_back(one);
  }
  return squares;
}

TEST(StudyStatistics, BoundsAreThoseOfChiSquareTables) {
  // 0.5 % and 99.5 % points of 10 and of 100 degrees of freedom (Pearson & Hartley, Biometrika Tables I, table 8).
  const MeanSquare ten = mean_square({{3.0, 4.0}, {9.0, 6.0}}, 0.99);
  EXPECT_DOUBLE_EQ(ten.mean, 1.2);
  EXPECT_NEAR(ten.expected.low, 0.215586, 1e-5);
  EXPECT_NEAR(ten.expected.high, 2.51882, 1e-4);
  EXPECT_NEAR(mean_square({{100.0, 100.0}}, 0.99).expected.high, 1.401690, 1e-5);
}

TEST(StudyStatistics, HonestSigmasLieInsideAndOthersOutside) {
  int inside = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const MeanSquare honest = mean_square(drawn(50, 6, 1.0, seed), 0.99);
    inside += honest.expected.holds(honest.mean) ? 1 : 0;
  }
  EXPECT_GE(inside, 388) << "of 400, 396 are expected";
  const MeanSquare optimistic = mean_square(drawn(50, 6, 1.2, 5), 0.99);
  EXPECT_GT(optimistic.mean, optimistic.expected.high);
  const MeanSquare pessimistic = mean_square(drawn(50, 6, 0.8, 5), 0.99);
  EXPECT_LT(pessimistic.mean, pessimistic.expected.low);
}

TEST(StudyStatistics, TheBootstrapHoldsTheMeanAsOftenAsItSays) {
  std::mt19937_64 engine(3);
  std::gamma_distribution<double> skewed(2.0, 0.5);  // mean 1
  int held = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> seeds(50);
    for (double& one : seeds) one = skewed(engine);
    held += bootstrap_mean(seeds, 0.95, static_cast<std::uint64_t>(trial)).holds(1.0) ? 1 : 0;
  }
  EXPECT_GE(held, 178) << "of 200, 190 are expected";
  EXPECT_LE(held, 199);
}

TEST(StudyStatistics, QuantilesLieBetweenTheValues) {
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_DOUBLE_EQ(quantile({0.0, 10.0}, 0.25), 2.5);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

}  // namespace
}  // namespace crosstie::study
