// The lens model is chosen by what views held out say, not by the residuals of those that took part.
#include <algorithm>

#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

const base::LensTrial& chosen_of(const base::Calibration& result) {
  const auto chosen = std::find_if(result.ladder.begin(), result.ladder.end(), [](const auto& trial) { return trial.chosen; });
  EXPECT_NE(chosen, result.ladder.end());
  return *chosen;
}

TEST(LensLadder, TakesNoMoreThanTheLensNeeds) {
  const auto scene = tests::make_scene(tests::scene_board(), {.stations = 12, .seed = 3});
  const auto result = calibrate(scene.views);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->ladder.size(), 4U);
  EXPECT_TRUE(result->ladder.back().lens.is_splined());
  EXPECT_FALSE(chosen_of(*result).lens.is_splined());
  EXPECT_NE(chosen_of(*result).lens, base::LensModel::kOpenCv8);
  // Richer models fit better what took part; the richest predicts worse.
  EXPECT_LT(result->ladder.back().rms_px, chosen_of(*result).rms_px);
  EXPECT_GT(result->ladder.back().rms_heldout_px, chosen_of(*result).rms_heldout_px);
  EXPECT_EQ(result->cameras[0].camera.model(), chosen_of(*result).lens);
  EXPECT_GT(result->cameras[0].rms_heldout_px, result->cameras[0].rms_px);
}

TEST(LensLadder, ClimbsToTheSplineWhereNoPolynomialFollowsTheLens) {
  const auto scene =
      tests::make_scene(tests::scene_board(), {.stations = 20, .seed = 3, .two_cameras = false, .ripple_px = 0.8});
  const auto result = calibrate(scene.views);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(chosen_of(*result).lens.is_splined());
  const auto brown = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  ASSERT_TRUE(brown) << brown.error().message;
  EXPECT_LT(result->rms_px, 0.5 * brown->rms_px);
  // Its projections are nearer to the truth, after the motion that a camera's own frame leaves open: seen here as differences
  // between neighbours, which no shift changes.
  const auto roughness = [&](const base::Camera& camera) {
    double sum = 0.0;
    for (int i = -6; i < 6; ++i) {
      const auto error = [&](int k) {
        const Eigen::Vector3d p(50.0 * k, 30.0, 1300.0);
        return Eigen::Vector2d(*camera.project(p) - scene.cameras[0].project(p));
      };
      sum += (error(i + 1) - error(i)).squaredNorm();
    }
    return std::sqrt(sum / 12.0);
  };
  EXPECT_LT(roughness(result->cameras[0].camera), 0.5 * roughness(brown->cameras[0].camera));
}

}  // namespace
}  // namespace crosstie::calib
