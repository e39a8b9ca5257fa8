#include "math/variance_components.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace crosstie::math {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A straight line a + b t observed by instruments with stated sigmas.
struct Line {
  Parameters parameters;
  WhitenedRows rows;
  std::vector<int> component;
  int block;

  Line() : block(parameters.add("line", {"a [mm]", "b [mm]"}, BlockRole::kKept)) {}
  void observe(int instrument, double t, double y, double stated_sigma) {
    const int blocks[] = {block};
    const int sizes[] = {2};
    const int g = rows.add(1, blocks, sizes);
    rows.residual(g)(0) = -y / stated_sigma;
    rows.jacobian(g, 0) << 1.0 / stated_sigma, t / stated_sigma;
    component.push_back(instrument);
  }
  [[nodiscard]] base::Result<std::vector<VarianceFactor>> estimate(int count) const {
    return variance_components(parameters, rows, MatrixXd(2, 0), component, count);
  }
};

// Three instruments of 6, 5 and 4 readings. The expected values maximise the restricted likelihood
// -1/2 (log det Sigma + log det A' Sigma^-1 A + v' Sigma^-1 v), found by a pattern search over the three variances in a few lines of
// Python of their own; the sigmas are the roots of 2 S^-1 with S summed over the dense M.
TEST(VarianceComponents, AreThoseOfTheRestrictedLikelihood) {
  const double t[] = {0, 1, 2, 3, 4, 5, 0.5, 1.5, 2.5, 3.5, 4.5, 0.2, 1.1, 2.9, 4.1};
  const double y[] = {0.11, 1.07, 1.83, 3.02, 3.96, 5.09, 0.9, 1.2, 2.9, 3.1, 4.9, 0.23, 1.06, 2.93, 4.05};
  const double stated[] = {0.1, 0.15, 0.1};
  Line line;
  for (int i = 0; i < 15; ++i) {
    const int instrument = i < 6 ? 0 : i < 11 ? 1 : 2;
    line.observe(instrument, t[i], y[i], stated[instrument]);
  }
  const auto found = line.estimate(3);
  ASSERT_TRUE(found) << found.error().message;
  const double variances[] = {0.01016818098, 0.14736477486, 0.00196333183};
  const double relative[] = {0.62738925621, 0.63545210500, 0.97271278523};
  const double redundancy[] = {5.50744726983, 4.97640112111, 2.51615160907};
  for (std::size_t i = 0; i < 3; ++i) {
    const VarianceFactor& of = (*found)[i];
    EXPECT_TRUE(of.estimated);
    EXPECT_NEAR(of.factor * stated[i] * stated[i] / variances[i], 1.0, 1e-4) << i;
    EXPECT_NEAR(of.sigma / of.factor, relative[i], 1e-4) << i;
    EXPECT_NEAR(of.redundancy, redundancy[i], 1e-3) << i;
    EXPECT_NEAR(of.dof, 2.0 / (relative[i] * relative[i]), 1e-2) << i;
  }
}

/// Readings with true sigmas of `ratio` times the stated ones.
Line drawn(std::uint64_t seed, const std::vector<int>& counts, const std::vector<double>& ratio) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Line line;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    for (int k = 0; k < counts[i]; ++k) {
      const double t = static_cast<double>(k) / counts[i];
      line.observe(static_cast<int>(i), t, 3.0 - 2.0 * t + 0.01 * ratio[i] * normal(random), 0.01);
    }
  }
  return line;
}

TEST(VarianceComponents, OfManyReadingsHaveTheirSigmasFromSampledTraces) {
  const Line line = drawn(1, {400, 300}, {10.0, 1.0 / 3.0});
  const auto found = line.estimate(2);
  ASSERT_TRUE(found) << found.error().message;
  // Dense S at the solution.
  const Eigen::Index n = 700;
  MatrixXd a(n, 2);
  for (int g = 0; g < n; ++g)
    a.row(g) = line.rows.jacobian(g, 0).row(0) /
               std::sqrt((*found)[static_cast<std::size_t>(line.component[static_cast<std::size_t>(g)])].factor);
  const MatrixXd m = MatrixXd::Identity(n, n) - a * (a.transpose() * a).ldlt().solve(a.transpose());
  Eigen::Matrix2d s;
  s << m.topLeftCorner(400, 400).squaredNorm(), m.topRightCorner(400, 300).squaredNorm(), 0.0,
      m.bottomRightCorner(300, 300).squaredNorm();
  s(1, 0) = s(0, 1);
  const Eigen::Matrix2d covariance = 2.0 * s.inverse();
  for (std::size_t i = 0; i < 2; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_NEAR((*found)[i].sigma / (*found)[i].factor / std::sqrt(covariance(k, k)), 1.0, 2e-3);
  }
  EXPECT_LT((*found)[0].probability_if_one(), 1e-6);
}

// x10 and /3, from few and many readings: the ratio of estimate and truth is chi-square over its degrees of freedom.
TEST(VarianceComponents, FindWrongSigmasWithinTheirOwn) {
  const std::vector<int> counts = {40, 12, 5};
  const std::vector<double> ratio = {10.0, 1.0, 1.0 / 3.0};
  std::vector<double> mean(3, 0.0);
  std::vector<int> outside(3, 0);
  constexpr int kSeeds = 400;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto found = drawn(static_cast<std::uint64_t>(seed), counts, ratio).estimate(3);
    ASSERT_TRUE(found) << seed << found.error().message;
    for (std::size_t i = 0; i < 3; ++i) {
      const double truth = ratio[i] * ratio[i];
      mean[i] += (*found)[i].factor / truth / kSeeds;
      outside[i] += truth < (*found)[i].low() || truth > (*found)[i].high() ? 1 : 0;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    // Unbiased with many readings only, since the weights are estimates themselves: five were 20 % too large in the mean, with true bounds.
    if (counts[i] >= 12) {
      EXPECT_NEAR(mean[i], 1.0, 3.3 * std::sqrt(2.0 / (counts[i] - 2) / kSeeds) + 0.01) << i;
    }
    // 5 % of 400 is 20 +- 4.4.
    EXPECT_NEAR(outside[i], 20, 15) << i;
  }
}

TEST(VarianceComponents, WhatNothingControlsIsKeptAsStated) {
  Line line = drawn(3, {20}, {2.0});
  line.observe(1, 1e6, 7.0, 0.01);  // far out: it alone tells the slope, and nothing controls it
  const auto found = line.estimate(2);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_TRUE((*found)[0].estimated);
  EXPECT_FALSE((*found)[1].estimated);
  EXPECT_EQ((*found)[1].factor, 1.0);
  EXPECT_EQ((*found)[1].probability_if_one(), 1.0);
}

}  // namespace
}  // namespace crosstie::math
