#include <cmath>

#include <gtest/gtest.h>

#include "tests/verify/point_sets.h"
#include "verify/compare.h"

namespace crosstie::verify {
namespace {

using base::PointList;
using tests::moved;
using tests::random_covariance;
using tests::random_points;
using tests::sample;
using tests::some_pose;

constexpr int kSeeds = 200;
constexpr int kPoints = 12;
constexpr double kBound = 3.29;  // 99.9 % of a normal distribution

struct Truth {
  PointList reference;  ///< in its frame
  base::Pose measured_from_reference;
};

/// Both sides with errors drawn from the covariances that they state.
std::pair<PointList, PointList> drawn(const Truth& truth, unsigned seed) {
  std::mt19937_64 random(seed);
  PointList measured = moved(truth.reference, truth.measured_from_reference);
  PointList reference = truth.reference;
  for (auto& point : measured.points) {
    point.cov_mm2 = random_covariance(random, 0.02);
    point.xyz_mm += sample(random, *point.cov_mm2);
  }
  for (auto& point : reference.points) {
    point.cov_mm2 = random_covariance(random, 0.005);
    point.xyz_mm += sample(random, *point.cov_mm2);
  }
  return {measured, reference};
}

/// sum of (d / sigma)^2 has the expectation 3 n whatever the correlations; of its variance 2 tr(C^2), C the correlation matrix
/// of rank 3 n - p, the bound used is that of equal eigenvalues times 1.3 for their spread (the point sets are well
/// distributed).
void expect_honest(Fit fit, bool weighted, int parameters) {
  const Truth truth{random_points(kPoints, 77), some_pose()};
  double sum = 0.0;
  double scale_sum = 0.0;
  double pose_sum = 0.0;
  double length_sum = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const auto [measured, reference] = drawn(truth, seed);
    const auto result = compare(measured, reference, {.fit = fit, .weighted = weighted});
    ASSERT_TRUE(result) << result.error().message;
    sum += 3.0 * kPoints * std::pow(result->normalised_rms, 2);
    scale_sum += std::pow(result->scale_ppm / result->scale_sigma_ppm, 2);
    const base::Vector6d error = base::difference(result->reference_from_measured, truth.measured_from_reference.inverse());
    if (fit == Fit::kRigid) {
      pose_sum += error.dot(result->pose_cov.ldlt().solve(error));
      const auto& length = result->lengths.back();
      length_sum += std::pow((length.measured_mm - length.nominal_mm) / length.sigma_mm, 2);
    }
  }
  const double rank = 3.0 * kPoints - parameters;
  const double expected = 3.0 * kPoints * kSeeds;
  const double sigma = 1.3 * std::sqrt(2.0 * 9.0 * kPoints * kPoints / rank * kSeeds);
  EXPECT_NEAR(sum, expected, kBound * sigma);
  EXPECT_NEAR(scale_sum, kSeeds, kBound * std::sqrt(2.0 * kSeeds));
  if (fit == Fit::kRigid) {
    EXPECT_NEAR(pose_sum, 6.0 * kSeeds, kBound * std::sqrt(2.0 * 6.0 * kSeeds));
    EXPECT_NEAR(length_sum, kSeeds, kBound * std::sqrt(2.0 * kSeeds));
  }
}

TEST(Sampling, RigidFit) { expect_honest(Fit::kRigid, false, 6); }
TEST(Sampling, WeightedRigidFit) { expect_honest(Fit::kRigid, true, 6); }
TEST(Sampling, SimilarityFit) { expect_honest(Fit::kSimilarity, false, 7); }

TEST(Sampling, FullCovarianceCarriesTheCommonScale) {
  // Points without any noise of their own worth mentioning, but one scale error of 50 ppm in common to all.
  const PointList truth = random_points(kPoints, 5);
  constexpr double kScaleSigma = 50e-6;
  double scale_sum = 0.0;
  double length_sum = 0.0;
  double sum = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const double scale_error = kScaleSigma * normal(random);
    CompareOptions options;
    options.measured_cov_mm2 = Eigen::MatrixXd::Zero(3 * kPoints, 3 * kPoints);
    PointList measured = truth;
    Eigen::VectorXd lever(3 * kPoints);
    for (int i = 0; i < kPoints; ++i) {
      auto& point = measured.points[static_cast<std::size_t>(i)];
      lever.segment<3>(3 * i) = point.xyz_mm;
      const Eigen::Matrix3d own = random_covariance(random, 0.001);
      options.measured_cov_mm2.block<3, 3>(3 * i, 3 * i) = own;
      point.xyz_mm += scale_error * point.xyz_mm + sample(random, own);
    }
    options.measured_cov_mm2 += kScaleSigma * kScaleSigma * lever * lever.transpose();
    const auto result = compare(measured, truth, options);
    ASSERT_TRUE(result) << result.error().message;
    scale_sum += std::pow(result->scale_ppm / result->scale_sigma_ppm, 2);
    const auto& length = result->lengths.back();
    length_sum += std::pow((length.measured_mm - length.nominal_mm) / length.sigma_mm, 2);
    sum += std::pow(result->normalised_rms, 2);
  }
  EXPECT_NEAR(scale_sum, kSeeds, kBound * std::sqrt(2.0 * kSeeds));
  EXPECT_NEAR(length_sum, kSeeds, kBound * std::sqrt(2.0 * kSeeds));
  // One error for all coordinates: the mean square of a seed is nearly one squared normal variable.
  EXPECT_NEAR(sum, kSeeds, kBound * std::sqrt(2.0 * kSeeds));
}

TEST(Sampling, WithoutSigmasTheScatterGivesThatOfThePose) {
  const PointList truth = random_points(kPoints, 6);
  double pose_sum = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0.0, 0.03);
    PointList measured = truth;
    for (auto& point : measured.points) point.xyz_mm += Eigen::Vector3d(normal(random), normal(random), normal(random));
    const auto result = compare(measured, truth);
    ASSERT_TRUE(result);
    const base::Vector6d error = base::difference(result->reference_from_measured, base::Pose());
    pose_sum += error.dot(result->pose_cov.ldlt().solve(error));
  }
  // Each is 6 F(6, 30): mean 6 * 30 / 28, variance 36 * 2 * 30^2 * 34 / (6 * 28^2 * 26).
  const double mean = 6.0 * 30.0 / 28.0;
  const double variance = 36.0 * 2.0 * 900.0 * 34.0 / (6.0 * 784.0 * 26.0);
  EXPECT_NEAR(pose_sum, mean * kSeeds, kBound * std::sqrt(variance * kSeeds));
}

}  // namespace
}  // namespace crosstie::verify
