#include <cmath>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "math/rigid_alignment.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

/// Root mean square of point errors after a rigid fit, over the predicted sigma: near 1 where the right minimum was found.
double normalised_rms(const tests::SyntheticNetwork& truth, const base::AdjustedNetwork& result) {
  std::vector<math::AlignmentPair> pairs;
  double predicted = 0.0;
  for (const auto& point : result.points) {
    math::AlignmentPair& pair = pairs.emplace_back();
    pair.a_mm = truth.point(point.id);
    pair.b_mm = point.xyz_mm;
    predicted += point.cov_mm2.trace();
  }
  const auto fit = math::align(pairs, {.weighted = false});
  EXPECT_TRUE(fit);
  double square = 0.0;
  for (const auto& residual : fit->residuals_mm) square += residual.squaredNorm();
  return std::sqrt(square / predicted);
}

void expect_solved(const tests::SyntheticNetwork& synthetic) {
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->images.size(), synthetic.network.images.size());
  EXPECT_EQ(result->points.size(), synthetic.points.size());
  EXPECT_LT(normalised_rms(synthetic, *result), 2.0);
  EXPECT_LT(static_cast<double>(result->rejected.size()), 0.01 * static_cast<double>(result->residuals.size()) + 1.0);
  for (std::size_t c = 0; c < result->cameras.size(); ++c) {
    const double error = result->cameras[c].camera.parameters()(0) - synthetic.cameras[c].parameters()(0);
    EXPECT_LT(std::abs(error), 5.0 * std::sqrt(result->cameras[c].camera.covariance()(0, 0)));
  }
}

TEST(Start, SolidObject) { expect_solved(tests::make_synthetic({})); }
TEST(Start, PlaneWithOneCamera) { expect_solved(tests::make_synthetic({.depth_mm = 0.0})); }
TEST(Start, PlaneWithTwoCameras) { expect_solved(tests::make_synthetic({.cameras = 2, .images = 16, .depth_mm = 0.0})); }
TEST(Start, FocalLengthOffByTenPercent) {
  expect_solved(tests::make_synthetic({.depth_mm = 0.0, .focal_error = 0.10}));
  expect_solved(tests::make_synthetic({.focal_error = -0.10}));
}
TEST(Start, StrongDistortion) {
  expect_solved(tests::make_synthetic({.cameras = 2, .images = 16, .depth_mm = 20.0, .k1 = -0.25}));
}
TEST(Start, NoisyImages) {
  expect_solved(tests::make_synthetic({.noise_px = 0.5, .stated_sigma_px = 0.02}));  // a detector that boasts
}

TEST(Start, TheFrameIsThatOfThePoints) {
  const auto result = adjust(tests::make_synthetic({.depth_mm = 20.0}).network);
  ASSERT_TRUE(result);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& point : result->points) {
    centre += point.xyz_mm;
    scatter += point.xyz_mm * point.xyz_mm.transpose();
  }
  EXPECT_LT(centre.norm(), 1e-6);
  EXPECT_LT(std::abs(scatter(0, 1)) + std::abs(scatter(0, 2)) + std::abs(scatter(1, 2)), 1e-6 * scatter.norm());
  EXPECT_GT(scatter(0, 0), scatter(1, 1));
  EXPECT_GT(scatter(1, 1), scatter(2, 2));
  for (const auto& image : result->images) EXPECT_GT(image.network_from_camera.translation_mm.z(), 0.0);
}

TEST(Start, TheOrderOfTheInputDoesNotMatterAndRunsRepeatThemselves) {
  tests::SyntheticNetwork synthetic = tests::make_synthetic({.cameras = 2, .images = 10, .depth_mm = 40.0});
  const auto first = adjust(synthetic.network);
  const auto again = adjust(synthetic.network);
  std::reverse(synthetic.network.images.begin(), synthetic.network.images.end());
  std::reverse(synthetic.network.cameras.begin(), synthetic.network.cameras.end());
  for (auto& image : synthetic.network.images) std::reverse(image.observations.begin(), image.observations.end());
  const auto reversed = adjust(synthetic.network);
  ASSERT_TRUE(first && again && reversed);
  for (const auto* other : {&*again, &*reversed}) {
    ASSERT_EQ(first->points.size(), other->points.size());
    for (std::size_t i = 0; i < first->points.size(); ++i) EXPECT_EQ(first->points[i].xyz_mm, other->points[i].xyz_mm);
    EXPECT_EQ(first->covariance, other->covariance);
    EXPECT_EQ(first->sigma0, other->sigma0);
  }
}

TEST(Start, CancellingStops) {
  std::stop_source source;
  base::Progress progress;
  progress.stop = source.get_token();
  progress.report = [&](std::string_view, std::size_t, std::size_t) { source.request_stop(); };
  const auto result = adjust(tests::make_synthetic({}).network, {}, progress);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kCancelled);
}

}  // namespace
}  // namespace crosstie::bundle
