#include "verify/repeatability.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::verify {
namespace {

using base::RepeatedQuantity;
using Eigen::Vector3d;

TEST(Repeatability, StandardDeviationHasItsInterval) {
  RepeatedQuantity quantity{.name = "d", .values = {10.1, 10.3, 9.9, 10.2, 10.0}, .sigmas = std::vector<double>(5, 0.1)};
  const auto group = repeat_group("diameter", {quantity});
  ASSERT_TRUE(group);
  const auto& of = group->quantities.front();
  EXPECT_NEAR(of.mean, 10.1, 1e-12);
  EXPECT_NEAR(of.sd, std::sqrt(0.025), 1e-12);
  // Chi-square with 4 degrees of freedom: 11.14329 and 0.4844186 (tables).
  EXPECT_NEAR(of.sd_low, std::sqrt(0.1 / 11.14329), 1e-6);
  EXPECT_NEAR(of.sd_high, std::sqrt(0.1 / 0.4844186), 1e-6);
  // s^2 / sigma^2 * 4 = 10; P(chi-square_4 > 10) = 6 exp(-5) in closed form.
  EXPECT_NEAR(of.p, 2.0 * 6.0 * std::exp(-5.0), 1e-9);
  EXPECT_NEAR(group->ratio, std::sqrt(2.5), 1e-12);
  EXPECT_FALSE(repeat_group("one run", {{.name = "d", .values = {1.0}}}));
}

TEST(Repeatability, TestOfManyKeepsItsLevelWhereQuantitiesGoTogether) {
  // 40 quantities, 30 of which share most of what they are; 5 runs.
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  int refused = 0;
  int found = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    for (const double too_small : {1.0, 2.5}) {
      std::vector<RepeatedQuantity> quantities(40);
      for (int run = 0; run < 5; ++run) {
        const double shared = normal(random);
        for (std::size_t k = 0; k < quantities.size(); ++k) {
          const double own = normal(random);
          quantities[k].values.push_back(0.01 * (k < 30 ? std::sqrt(0.8) * shared + std::sqrt(0.2) * own : own));
          quantities[k].sigmas.push_back(0.01 / too_small);
        }
      }
      const auto group = repeat_group("all", quantities);
      ASSERT_TRUE(group);
      (too_small > 1.0 ? found : refused) += group->p < 0.05 ? 1 : 0;
      EXPECT_GE(group->dof, 4.0);
      EXPECT_LE(group->dof, 160.0);
    }
  }
  // 5 % of 400 is 20 +- 4.4. Degrees of freedom that are themselves estimated make it 7 %: 28 + 3.3 * 5.1.
  EXPECT_LE(refused, 45);
  EXPECT_GT(found, 300);
}

/// A free network of twelve points, drawn with a joint covariance, each run in a frame of its own.
std::vector<RepeatedPoints> networks(int runs, double stated, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::mt19937_64 layout(3);
  std::uniform_real_distribution<double> place(-800.0, 800.0);
  std::vector<Vector3d> truth;
  for (int i = 0; i < 12; ++i) truth.emplace_back(place(layout), place(layout), 0.3 * place(layout));
  Eigen::MatrixXd root(36, 36);
  for (double& value : root.reshaped()) value = 0.002 * normal(layout);
  const Eigen::MatrixXd covariance = root * root.transpose();
  std::vector<RepeatedPoints> result;
  for (int r = 0; r < runs; ++r) {
    RepeatedPoints run{.run = "run " + std::to_string(r), .points = {}};
    Eigen::VectorXd noise(36);
    for (double& value : noise) value = normal(random);
    const Eigen::VectorXd off = root * noise;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.3 * r, Vector3d(1.0, 0.2 * r, 0.4).normalized()));
    const Eigen::Matrix3d matrix = turn.toRotationMatrix();
    Eigen::MatrixXd turned(36, 36);
    for (Eigen::Index i = 0; i < 36; i += 3) {
      for (Eigen::Index j = 0; j < 36; j += 3)
        turned.block<3, 3>(i, j) = matrix * covariance.block<3, 3>(i, j) * matrix.transpose();
    }
    for (int i = 0; i < 12; ++i) {
      const Vector3d p = turn * (truth[static_cast<std::size_t>(i)] + off.segment<3>(3 * i)) + Vector3d(100.0 * r, 0.0, 50.0);
      run.points.points.push_back({100 + i, p, std::nullopt});
    }
    run.cov_mm2 = stated * stated * turned;
    result.push_back(std::move(run));
  }
  return result;
}

TEST(Repeatability, AdjustedPointsInFramesOfTheirOwnHaveTrueSigmas) {
  std::mt19937_64 random(11);
  double square = 0.0;
  int refused = 0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto group = repeat_points(networks(6, 1.0, random), true);
    ASSERT_TRUE(group) << group.error().message;
    ASSERT_EQ(group->quantities.size(), 36U);
    square += group->ratio * group->ratio / kTrials;
    refused += group->p < 0.05 ? 1 : 0;
  }
  EXPECT_NEAR(square, 1.0, 0.06);
  EXPECT_LE(refused, 10);
  const auto wrong = repeat_points(networks(6, 0.4, random), true);
  ASSERT_TRUE(wrong);
  EXPECT_NEAR(wrong->ratio, 2.5, 0.8);
  EXPECT_LT(wrong->p, 1e-3);
}

/// An oval rim of 400 by 300 mm in a tilted plane, points 3 to 5 mm apart at places of their own.
RepeatedRim rim(std::mt19937_64& random, double sigma, bool gap) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> step(0.015, 0.025);
  const Eigen::Matrix3d frame = Eigen::AngleAxisd(0.7, Vector3d(0.3, 1.0, 0.2).normalized()).toRotationMatrix();
  RepeatedRim result;
  for (double t = step(random); t < 2.0 * std::numbers::pi; t += step(random)) {
    if (gap && t > 1.0 && t < 1.3) continue;
    base::EdgePoint p;
    const Vector3d tangent = Vector3d(-200.0 * std::sin(t), 150.0 * std::cos(t), 0.0).normalized();
    const Vector3d across = Vector3d::UnitZ().cross(tangent);
    p.point_mm = frame * (Vector3d(200.0 * std::cos(t), 150.0 * std::sin(t), 0.0) + sigma * normal(random) * across +
                          2.0 * sigma * normal(random) * Vector3d::UnitZ()) +
                 Vector3d(1000.0, 200.0, -300.0);
    p.normal = frame * Vector3d::UnitZ();
    p.tangent = frame * tangent;
    p.sigma_u_mm = 0.03;
    p.sigma_v_mm = 0.06;
    result.points.push_back(p);
  }
  return result;
}

TEST(Repeatability, RimsAreComparedByAngle) {
  std::mt19937_64 random(5);
  std::vector<RepeatedRim> runs;
  for (int r = 0; r < 8; ++r) runs.push_back(rim(random, 0.03, r == 2));
  const auto groups = repeat_rims(runs, 72, 12.0);
  ASSERT_TRUE(groups) << groups.error().message;
  ASSERT_EQ(groups->size(), 2U);
  EXPECT_LT((*groups)[0].quantities.size(), 72U);  // the gap of one run
  EXPECT_GT((*groups)[0].quantities.size(), 64U);
  for (const auto& group : *groups) {
    // Between two independent points the variance is 2/3 of that of one in the mean: no smaller sigma is claimed, so that ratio is 0.82.
    EXPECT_NEAR(group.ratio, std::sqrt(2.0 / 3.0), 0.08) << group.name;
  }
  EXPECT_NEAR((*groups)[1].predicted, 0.06, 1e-9);
  std::vector<RepeatedRim> rough;
  for (int r = 0; r < 8; ++r) rough.push_back(rim(random, 0.12, false));
  const auto worse = repeat_rims(rough, 72, 12.0);
  ASSERT_TRUE(worse);
  EXPECT_GT((*worse)[0].ratio_low, 2.0);
  EXPECT_LT((*worse)[0].p, 1e-6);
}

}  // namespace
}  // namespace crosstie::verify
