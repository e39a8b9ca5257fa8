// What the observations do not determine is refused, with the weak part named; it is never given a number.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

void expect_no_solution(const base::Network& network, const std::string& word, const AdjustOptions& options = {}) {
  const auto result = adjust(network, options);
  ASSERT_FALSE(result) << "sigma0 " << result->sigma0 << ", " << result->images.size() << " images";
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution) << result.error().message;
  EXPECT_NE(result.error().message.find(word), std::string::npos) << result.error().message;
}

TEST(Degenerate, OneImage) {
  auto synthetic = tests::make_synthetic({});
  synthetic.network.images.resize(1);
  expect_no_solution(synthetic.network, "one image");
}

TEST(Degenerate, OneProjectionCentre) {
  expect_no_solution(tests::make_synthetic({.images = 8, .moving = false}).network, "projection centre");
  expect_no_solution(tests::make_synthetic({.images = 8, .depth_mm = 0.0, .moving = false}).network, "projection centre");
}

TEST(Degenerate, BlocksWithoutCommonPoints) {
  auto synthetic = tests::make_synthetic({.images = 12});
  for (std::size_t i = 0; i < synthetic.network.images.size(); ++i) {
    std::erase_if(synthetic.network.images[i].observations,
                  [&](const auto& observation) { return (observation.id < 25) != (i < 6); });
  }
  synthetic.network.scale_bars[0] = {10, 24, synthetic.distance(10, 24), 0.01, 20.0, 0.0, base::ScaleBarRole::kUsed, ""};
  synthetic.network.scale_bars[1] = {25, 39, synthetic.distance(25, 39), 0.01, 20.0, 0.0, base::ScaleBarRole::kUsed, ""};
  expect_no_solution(synthetic.network, "i00 ... i05 (6 images)");
}

TEST(Degenerate, NoCommonMarkersAtAll) {
  auto synthetic = tests::make_synthetic({.images = 4});
  for (std::size_t i = 0; i < 4; ++i) {
    std::erase_if(synthetic.network.images[i].observations,
                  [&](const auto& observation) { return observation.id % 4 != static_cast<int>(i); });
  }
  const auto result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
}

// Parallel views of a plane, the camera never rolled or tilted: focal length and distance cannot be told apart, nor the
// principal point from the position.
TEST(Degenerate, ParallelUnrolledViewsOfAPlaneWithFreeInteriorOrientation) {
  auto synthetic = tests::make_synthetic({.images = 9, .depth_mm = 0.0, .rolled = false});
  tests::Random random(17);
  for (std::size_t i = 0; i < synthetic.network.images.size(); ++i) {
    const Eigen::Vector3d position(120.0 * static_cast<double>(i % 3) - 120.0, 90.0 * static_cast<double>(i / 3) - 90.0,
                                   1200.0);
    const base::Pose pose = tests::looking_at(position, position - Eigen::Vector3d(0.0, 0.0, 1000.0), 0.0);
    auto& observations = synthetic.network.images[i].observations;
    const base::Observation form = observations.front();
    observations.clear();
    for (std::size_t p = 0; p < synthetic.points.size(); ++p) {
      base::Observation observation = form;
      observation.id = synthetic.ids[p];
      observation.centre_px = *synthetic.cameras[0].project(pose.inverse() * synthetic.points[p]) +
                              0.02 * Eigen::Vector2d(random.normal(), random.normal());
      observations.push_back(observation);
    }
  }
  expect_no_solution(synthetic.network, "fx [px]");
}

TEST(Degenerate, TooFewMarkersForTheUnknownLens) {
  auto synthetic = tests::make_synthetic({.images = 3, .columns = 4, .rows = 2});
  const auto result = adjust(synthetic.network);
  if (!result) {
    EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution) << result.error().message;
  } else {
    EXPECT_GE(result->redundancy, 0);
  }
}

TEST(Degenerate, NoMarkers) {
  auto synthetic = tests::make_synthetic({});
  for (auto& image : synthetic.network.images) image.observations.clear();
  expect_no_solution(synthetic.network, "no coded marker");
}

TEST(Degenerate, BadInputIsNamed) {
  auto synthetic = tests::make_synthetic({});
  auto network = synthetic.network;
  network.images[3].camera = "other";
  auto result = adjust(network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_NE(result.error().message.find("i03"), std::string::npos);

  network = synthetic.network;
  network.images[3].image = "i02";
  EXPECT_EQ(adjust(network).error().code, base::ErrorCode::kBadInput);

  network = synthetic.network;
  network.images[3].width_px = 1333;
  EXPECT_EQ(adjust(network).error().code, base::ErrorCode::kBadInput);

  network = synthetic.network;
  network.images[3].observations[2].centre_px.x() = std::nan("");
  EXPECT_EQ(adjust(network).error().code, base::ErrorCode::kBadInput);
}

TEST(Degenerate, BadOptionsAreNamed) {
  const auto synthetic = tests::make_synthetic({});
  for (const AdjustOptions& options :
       {AdjustOptions{.sigma_px = 0.0}, AdjustOptions{.significance = 0.7}, AdjustOptions{.start_pairs = 0}}) {
    const auto result = adjust(synthetic.network, options);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, base::ErrorCode::kUsage);
  }
}

TEST(Degenerate, HeldAndKnownLensesAreUsedAsTheyAre) {
  auto synthetic = tests::make_synthetic({.depth_mm = 30.0});
  synthetic.network.cameras[0].camera = synthetic.cameras[0];
  synthetic.network.cameras[0].estimate = false;
  const auto held = adjust(synthetic.network);
  ASSERT_TRUE(held) << held.error().message;
  EXPECT_FALSE(held->cameras[0].estimated);
  EXPECT_EQ(held->cameras[0].camera.parameters(), synthetic.cameras[0].parameters());

  // A prior ten times tighter than the images alone can tell must show in the sigma.
  synthetic.network.cameras[0].estimate = true;
  const auto free = adjust(synthetic.network);
  ASSERT_TRUE(free);
  const Eigen::MatrixXd loose = free->cameras[0].camera.covariance();
  synthetic.network.cameras[0].camera.set_covariance(0.01 * loose);
  const auto prior = adjust(synthetic.network);
  ASSERT_TRUE(prior) << prior.error().message;
  EXPECT_LT(prior->cameras[0].camera.covariance()(0, 0), 0.0102 * loose(0, 0));
  EXPECT_EQ(prior->observations, free->observations + 9);

  // Of one parameter something is known, of the others nothing.
  Eigen::VectorXd variances = Eigen::VectorXd::Constant(9, std::numeric_limits<double>::infinity());
  variances(0) = 0.01 * loose(0, 0);
  synthetic.network.cameras[0].camera.set_covariance(variances.asDiagonal());
  const auto one = adjust(synthetic.network);
  ASSERT_TRUE(one) << one.error().message;
  EXPECT_LT(one->cameras[0].camera.covariance()(0, 0), 0.0102 * loose(0, 0));
  EXPECT_EQ(one->observations, free->observations + 1);

  synthetic.network.cameras[0].camera.set_covariance(0.01 * loose);
  synthetic.network.cameras[0].held = {"k3"};
  const auto without = adjust(synthetic.network);
  ASSERT_TRUE(without);
  EXPECT_EQ(without->cameras[0].camera.parameters()(8), synthetic.cameras[0].parameters()(8));
  EXPECT_EQ(without->unknowns, prior->unknowns - 1);
}

TEST(Degenerate, AHeldParameterThatNoLensHasIsNamed) {
  auto synthetic = tests::make_synthetic({});
  synthetic.network.cameras[0].held = {"q1"};
  const auto result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_THAT(result.error().message, testing::HasSubstr("q1"));
}

}  // namespace
}  // namespace crosstie::bundle
