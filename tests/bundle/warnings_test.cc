// What weakens a network is told, and only then: every warning beside a network that is free of it.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

const base::Warning* find(const base::AdjustedNetwork& result, const std::string& code) {
  const auto found =
      std::find_if(result.warnings.begin(), result.warnings.end(), [&](const auto& w) { return w.code == code; });
  return found == result.warnings.end() ? nullptr : &*found;
}

base::AdjustedNetwork adjusted(const base::Network& network) {
  auto result = adjust(network);
  EXPECT_TRUE(result) << result.error().message;
  return result ? *std::move(result) : base::AdjustedNetwork();
}

void keep_images(base::Network& network, const std::function<bool(std::size_t)>& wanted) {
  std::vector<base::ImageObservations> kept;
  for (std::size_t i = 0; i < network.images.size(); ++i) {
    if (wanted(i)) kept.push_back(network.images[i]);
  }
  network.images = std::move(kept);
}

/// Deep points that fill the image, all round, rolled, calibrated with a model whose terms are all there.
tests::SyntheticNetwork sound() {
  return tests::make_synthetic({.images = 16, .columns = 10, .rows = 7, .model = base::LensModel::kOpenCv4});
}

TEST(Warnings, ASoundNetworkHasNone) {
  const auto result = adjusted(sound().network);
  for (const char* code :
       {"few_rays", "small_angle", "one_side", "planar_points", "planar_not_rolled", "not_rolled", "one_scale_bar",
        "contradicting_bars", "id_twice", "poor_coverage", "small_in_image", "not_significant", "image_not_oriented"}) {
    const base::Warning* warning = find(result, code);
    EXPECT_EQ(warning, nullptr) << code << ": " << warning->message;
  }
}

TEST(Warnings, FewRays) {
  auto synthetic = sound();
  int kept = 0;
  for (auto& image : synthetic.network.images) {
    std::erase_if(image.observations, [&](const auto& one) { return one.id == 22 && kept++ >= 2; });
  }
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "few_rays"), nullptr);
  EXPECT_EQ(find(result, "few_rays")->subject, "22");
}

TEST(Warnings, SmallAngle) {
  // One point that only images from nearly the same direction show.
  auto synthetic = sound();
  std::size_t count = 0;
  for (std::size_t i = 0; i < synthetic.network.images.size(); ++i) {
    const auto& at = synthetic.network_from_camera[i].translation_mm;
    const Eigen::Vector3d& first = synthetic.network_from_camera[0].translation_mm;
    const Eigen::Vector3d point = synthetic.point(22);
    const double cosine = (at - point).normalized().dot((first - point).normalized());
    const bool near = cosine > std::cos(14.0 * std::numbers::pi / 180.0);
    if (!near && i > 2) std::erase_if(synthetic.network.images[i].observations, [](const auto& one) { return one.id == 22; });
    count += near ? 1 : 0;
  }
  // Images 1 and 2 take the place of the first, a hand's breadth aside.
  for (const std::size_t i : {1U, 2U}) {
    auto pose = synthetic.network_from_camera[0];
    pose.translation_mm += Eigen::Vector3d(60.0 * static_cast<double>(i), -40.0, 10.0);
    auto& observations = synthetic.network.images[i].observations;
    std::erase_if(observations, [&](auto& one) {
      const auto pixel = synthetic.cameras[0].project(pose.inverse() * synthetic.point(one.id));
      if (pixel) one.centre_px = *pixel;
      return !pixel;
    });
  }
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "small_angle"), nullptr);
  EXPECT_EQ(find(result, "small_angle")->subject, "22");
}

TEST(Warnings, OneSide) {
  auto synthetic = sound();
  keep_images(synthetic.network, [](std::size_t i) { return i < 6; });  // 6 of 16 places round the points
  EXPECT_NE(find(adjusted(synthetic.network), "one_side"), nullptr);
}

TEST(Warnings, FacingCamerasAreNoSide) {
  auto synthetic = sound();
  keep_images(synthetic.network, [](std::size_t i) { return i % 8 < 2; });  // two and two, opposite each other
  EXPECT_EQ(find(adjusted(synthetic.network), "one_side"), nullptr);
}

TEST(Warnings, NoRolledImages) {
  // From above, so that going round does not roll the camera against the points.
  tests::SyntheticOptions options{.images = 16, .rolled = false, .model = base::LensModel::kOpenCv4};
  const auto deep = adjusted(tests::make_synthetic(options).network);
  ASSERT_NE(find(deep, "not_rolled"), nullptr);
  EXPECT_EQ(find(deep, "not_rolled")->subject, "c0");
  EXPECT_EQ(find(deep, "planar_not_rolled"), nullptr);

  auto given = tests::make_synthetic(options);
  given.network.cameras[0].camera = given.cameras[0];
  given.network.cameras[0].estimate = false;
  EXPECT_EQ(find(adjusted(given.network), "not_rolled"), nullptr) << "nothing is calibrated";

  options.depth_mm = 0.0;
  const auto flat = adjusted(tests::make_synthetic(options).network);
  EXPECT_NE(find(flat, "planar_not_rolled"), nullptr);
  EXPECT_EQ(find(flat, "not_rolled"), nullptr);
}

TEST(Warnings, PlanarPointsWithAFreeLens) {
  auto synthetic = tests::make_synthetic({.images = 16, .depth_mm = 0.0, .model = base::LensModel::kOpenCv4});
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "planar_points"), nullptr);
  EXPECT_EQ(find(result, "planar_points")->subject, "c0");

  synthetic.network.cameras[0].camera = result.cameras[0].camera;  // with its covariance: a calibration
  EXPECT_EQ(find(adjusted(synthetic.network), "planar_points"), nullptr);
}

TEST(Warnings, OneScaleBarAndContradictingBars) {
  auto synthetic = sound();
  auto bars = synthetic.network.scale_bars;
  synthetic.network.scale_bars.pop_back();
  EXPECT_NE(find(adjusted(synthetic.network), "one_scale_bar"), nullptr);
  bars[0].length_mm += 0.5;
  synthetic.network.scale_bars = bars;
  EXPECT_NE(find(adjusted(synthetic.network), "contradicting_bars"), nullptr);
}

TEST(Warnings, AnIdReadTwice) {
  auto synthetic = sound();
  base::Observation twin = *tests::find_observation(synthetic.network, "i04", 22);
  twin.centre_px += Eigen::Vector2d(-140.0, 60.0);
  synthetic.network.images[4].observations.push_back(twin);
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "id_twice"), nullptr);
  EXPECT_EQ(find(result, "id_twice")->subject, "22 in i04");
}

TEST(Warnings, PoorCoverage) {
  auto synthetic = sound();
  for (auto& image : synthetic.network.images) {
    std::erase_if(image.observations, [](const auto& one) { return std::abs(one.centre_px.x() - 1000.0) > 320.0; });
  }
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "poor_coverage"), nullptr);
  EXPECT_EQ(find(result, "poor_coverage")->subject, "c0");
  EXPECT_GT(result.cameras[0].coverage, 0.2);
  EXPECT_LT(result.cameras[0].coverage, 0.5);
}

TEST(Warnings, PointsInASmallPartOfAnImage) {
  auto synthetic = sound();
  auto& observations = synthetic.network.images[7].observations;
  const Eigen::Vector2d middle = tests::find_observation(synthetic.network, "i07", 24)->centre_px;
  std::erase_if(observations, [&](const auto& one) { return (one.centre_px - middle).cwiseAbs().maxCoeff() > 160.0; });
  ASSERT_GE(observations.size(), 4U);
  const auto result = adjusted(synthetic.network);
  ASSERT_NE(find(result, "small_in_image"), nullptr);
  EXPECT_EQ(find(result, "small_in_image")->subject, "i07");
}

TEST(Warnings, ADistortionTermThatIsNotThere) {
  const auto synthetic = tests::make_synthetic({.images = 16});  // with k3, which is 0 in truth
  const auto result = adjusted(synthetic.network);
  const auto& p = result.cameras[0].significance_p;
  ASSERT_EQ(p.size(), 9);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(std::isnan(p(i))) << "no test of focal length and principal point";
  EXPECT_LT(p(4), 1e-6) << "k1 is -0.1";
  EXPECT_GT(p(8), 0.05);
  const double t = result.cameras[0].camera.parameters()(8) / std::sqrt(result.cameras[0].camera.covariance()(8, 8));
  EXPECT_NEAR(p(8), std::erfc(std::abs(t) / std::numbers::sqrt2), 0.002) << "many degrees of freedom: nearly normal";
  ASSERT_NE(find(result, "not_significant"), nullptr);
  EXPECT_NE(find(result, "not_significant")->message.find("k3"), std::string::npos);
}

}  // namespace
}  // namespace crosstie::bundle
