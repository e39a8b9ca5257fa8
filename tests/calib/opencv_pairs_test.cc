// The 13 pairs that OpenCV ships: the same minimum as OpenCV and mrcal find under the same assumptions, and better predictions of
// what was not seen with a board that need not be plane.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/calib/real_boards.h"

namespace crosstie::calib {
namespace {

class OpenCvPairs : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = tests::measured_data("stereo-boards");
    if (folder_.empty()) GTEST_SKIP() << "no stereo-boards in CROSSTIE_DATA";
  }
  std::filesystem::path folder_;
};

TEST_F(OpenCvPairs, ARigidBoardLeadsWhereOpenCvAndMrcalAgree) {
  const auto result = calibrate(tests::opencv_pairs(folder_, false), {.lens = base::LensModel::kOpenCv4});
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->rig);
  EXPECT_NEAR(result->cameras[0].camera.focal_px().x(), 533.5625, 1e-3);
  EXPECT_NEAR(result->rig->baseline_mm, 83.183, 1e-3);
  EXPECT_NEAR(result->rms_px, 0.2153, 1e-4);
  EXPECT_TRUE(result->rejected.empty());
  // Why it is not to be believed: its halves contradict each other, and it says so.
  EXPECT_GT(std::abs(result->validation->baseline_gap_mm), 3.0 * result->validation->baseline_gap_sigma_mm);
  EXPECT_TRUE(std::any_of(result->warnings.begin(), result->warnings.end(),
                          [](const auto& warning) { return warning.code == "halves_contradict"; }));
}

TEST_F(OpenCvPairs, AFreeBoardPredictsWhatItHasNotSeen) {
  const BoardViews views = tests::opencv_pairs(folder_, true);
  const auto result = calibrate(views);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->validation);
  const base::CrossValidation& validation = *result->validation;
  ASSERT_EQ(validation.halves.size(), 2U);
  for (const auto& half : validation.halves) {
    EXPECT_LE(half.rms_px[0], 0.16) << half.name;
    EXPECT_LE(half.rms_px[1], 0.17) << half.name;
    EXPECT_GT(half.rms_px[0], 0.05) << half.name;
  }
  EXPECT_LE(std::abs(validation.baseline_gap_mm), 0.10);
  EXPECT_LE(std::abs(validation.baseline_gap_mm), 2.0 * validation.baseline_gap_sigma_mm);
  // A sigma that promises something: most of it is the pitch's.
  EXPECT_LT(result->rig->baseline_sigma_mm, 0.11);
  EXPECT_GT(result->rig->baseline_sigma_mm, 0.08);
  EXPECT_LT(result->board.prior_ratio, 1.0);  // the prior is wide enough for this board
}

TEST_F(OpenCvPairs, TheSameBytesForAnyNumberOfThreads) {
  const BoardViews views = tests::opencv_pairs(folder_, true);
  const auto one = calibrate(views, {.threads = 1});
  const auto three = calibrate(views, {.threads = 3});
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->cameras[0].camera.parameters(), three->cameras[0].camera.parameters());
  EXPECT_EQ(one->covariance, three->covariance);
  EXPECT_EQ(one->validation->baseline_gap_mm, three->validation->baseline_gap_mm);
}

}  // namespace
}  // namespace crosstie::calib
