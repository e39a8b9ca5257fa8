#include "math/rigid_alignment.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "math/distributions.h"

namespace crosstie::math {
namespace {

const base::Pose kTruth{Eigen::Quaterniond(0.8, -0.3, 0.4, 0.2).normalized(), Eigen::Vector3d(1500.0, -320.0, 75.0)};

std::vector<AlignmentPair> make_pairs(double scale, bool flat = false) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> place(-400.0, 400.0);
  std::vector<AlignmentPair> pairs;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d b(900.0 + place(random), place(random), flat ? 0.0 : 0.5 * place(random));
    AlignmentPair pair;
    pair.a_mm = kTruth.rotation * (scale * b) + kTruth.translation_mm;
    pair.b_mm = b;
    pairs.push_back(pair);
  }
  return pairs;
}

TEST(RigidAlignment, FindsAnExactMotion) {
  for (const bool with_scale : {false, true}) {
    const auto result = align(make_pairs(with_scale ? 1.002 : 1.0), {.with_scale = with_scale});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(base::difference(kTruth, result->a_from_b).head<3>().norm(), 1e-12);
    EXPECT_LT((kTruth.translation_mm - result->a_from_b.translation_mm).norm(), 1e-9);
    EXPECT_NEAR(result->scale, with_scale ? 1.002 : 1.0, 1e-13);
    for (const auto& residual : result->residuals_mm) EXPECT_LT(residual.norm(), 1e-9);
  }
}

// 300 noisy repetitions: the errors of [rotation, translation, scale] must have the covariance that is stated.
TEST(RigidAlignment, StatesItsCovarianceTruly) {
  for (const bool with_scale : {false, true}) {
    const int parameters = with_scale ? 7 : 6;
    const std::vector<AlignmentPair> exact = make_pairs(1.0);
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    double sum = 0.0;
    const int repetitions = 300;
    for (int k = 0; k < repetitions; ++k) {
      std::vector<AlignmentPair> pairs = exact;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        Eigen::Matrix3d a = Eigen::Vector3d(0.01, 0.02, 0.03 + 0.01 * static_cast<double>(i)).asDiagonal();
        a(1, 0) = 0.01;
        const Eigen::Matrix3d b = Eigen::Vector3d(0.03, 0.01, 0.01).asDiagonal();
        pairs[i].cov_a_mm2 = a * a.transpose();
        pairs[i].cov_b_mm2 = b * b.transpose();
        pairs[i].a_mm += a * Eigen::Vector3d(normal(random), normal(random), normal(random));
        pairs[i].b_mm += b * Eigen::Vector3d(normal(random), normal(random), normal(random));
      }
      const auto result = align(pairs, {.with_scale = with_scale});
      ASSERT_TRUE(result) << result.error().message;
      EXPECT_TRUE(result->weighted);
      Eigen::VectorXd error(7);
      error << base::difference(result->a_from_b, kTruth), 1.0 - result->scale;
      const Eigen::MatrixXd cov = result->covariance.topLeftCorner(parameters, parameters);
      sum += error.head(parameters).dot(cov.ldlt().solve(error.head(parameters)));
    }
    EXPECT_GT(sum, chi_square_quantile(0.0005, repetitions * parameters));
    EXPECT_LT(sum, chi_square_quantile(0.9995, repetitions * parameters));
  }
}

TEST(RigidAlignment, RefusesTooFewAndCollinearPoints) {
  std::vector<AlignmentPair> pairs = make_pairs(1.0);
  EXPECT_EQ(align(std::span(pairs).first(2)).error().code, base::ErrorCode::kNoUniqueSolution);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pairs[i].b_mm = Eigen::Vector3d(10.0 * static_cast<double>(i), 20.0, 30.0);
    pairs[i].a_mm = kTruth * pairs[i].b_mm;
  }
  EXPECT_EQ(align(pairs).error().code, base::ErrorCode::kNoUniqueSolution);
  // On a line as far as their sigmas can tell.
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pairs[i].a_mm.z() += i % 2 == 0 ? 0.01 : -0.01;
    pairs[i].cov_a_mm2 = pairs[i].cov_b_mm2 = 0.01 * 0.01 * Eigen::Matrix3d::Identity();
  }
  EXPECT_EQ(align(pairs).error().code, base::ErrorCode::kNoUniqueSolution);
}

TEST(RigidAlignment, ReportsAMirrorImage) {
  std::vector<AlignmentPair> pairs = make_pairs(1.0);
  for (auto& pair : pairs) pair.b_mm.x() = -pair.b_mm.x();
  const auto result = align(pairs);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_NE(result.error().message.find("left-handed"), std::string::npos);
}

TEST(RigidAlignment, NoiseOnAPlaneIsNoMirror) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 50; ++k) {
    std::vector<AlignmentPair> pairs = make_pairs(1.0, true);
    for (auto& pair : pairs) pair.a_mm += 0.01 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const auto result = align(pairs);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(result->sigma0, 0.02);
  }
}

TEST(RigidAlignment, NamesThePairWithoutCovariance) {
  std::vector<AlignmentPair> pairs = make_pairs(1.0);
  for (auto& pair : pairs) pair.cov_a_mm2 = Eigen::Matrix3d::Identity();
  pairs[4].cov_a_mm2.setZero();
  const auto result = align(pairs);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("pair 5"), std::string::npos);
  EXPECT_TRUE(align(pairs, {.weighted = false}));
}

}  // namespace
}  // namespace crosstie::math
