// mrcal's solve beside ours: the published agreement on OpenCV's pairs, and refusals.
#include "calib/second_opinion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calib/real_boards.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

class MrcalOnOpenCvPairs : public testing::Test {
 protected:
  void SetUp() override {
    const auto folder = tests::measured_data("stereo-boards");
    if (folder.empty()) GTEST_SKIP() << "no stereo-boards in CROSSTIE_DATA";
    auto ours = calibrate(tests::opencv_pairs(folder, false),
                          {.lens = base::LensModel::kOpenCv4, .cross_validate = false, .reject_outliers = false});
    ASSERT_TRUE(ours) << ours.error().message;
    ours_ = std::move(*ours);
  }
  base::Calibration ours_;
};

// The figures that OpenCV's joint calibration and mrcal's command line agree on for these corners.
TEST_F(MrcalOnOpenCvPairs, ARigidBoardGivesTheSameAnswerThrice) {
  const auto opinion = second_opinion(ours_);
  ASSERT_TRUE(opinion) << opinion.error().message;
  EXPECT_NEAR(opinion->parameters[0][0], 533.562, 1e-3);
  EXPECT_NEAR(opinion->parameters[1][0], 536.893, 2e-3);
  EXPECT_NEAR(opinion->baseline_mm, 83.183, 1e-3);
  EXPECT_NEAR(opinion->rms_px, 0.2153, 1e-4);
  EXPECT_EQ(opinion->rejected, 0);
  EXPECT_NEAR(opinion->our_rms_px, opinion->rms_px, 1e-5);
  EXPECT_NEAR(opinion->our_focal_px[0], opinion->parameters[0][0], 2e-3);
  EXPECT_NEAR(opinion->our_baseline_mm, opinion->baseline_mm, 1e-3);
  ASSERT_EQ(opinion->difference_rms_px.size(), 2U);
  for (const double difference : opinion->difference_rms_px) EXPECT_LT(difference, 1e-3);
}

// mrcal-calibrate-cameras on these corners with OPENCV5 and its bent board: 533.641, 537.413, 83.166 mm.
TEST_F(MrcalOnOpenCvPairs, ABentBoardIsAsMrcalFindsIt) {
  const auto opinion = second_opinion(ours_, {.lens = base::LensModel::kOpenCv5, .bent = true, .reject_outliers = true});
  ASSERT_TRUE(opinion) << opinion.error().message;
  EXPECT_NEAR(opinion->parameters[0][0], 533.641, 2e-3);
  EXPECT_NEAR(opinion->parameters[1][0], 537.413, 2e-3);
  EXPECT_NEAR(opinion->baseline_mm, 83.166, 1e-3);
  EXPECT_NEAR(opinion->rms_px, 0.2075, 1e-4);
  EXPECT_GT(opinion->bends_mm.norm(), 0.01);
  EXPECT_TRUE(opinion->our_focal_px.empty());  // our own solver has no such board
}

TEST_F(MrcalOnOpenCvPairs, SplinesFitMoreClosely) {
  const auto opinion = second_opinion(ours_, {.lens = *base::LensModel::splined({3, 12, 9, 70}), .bent = true});
  ASSERT_TRUE(opinion) << opinion.error().message;
  EXPECT_LT(opinion->rms_px, 0.19);
  EXPECT_GT(opinion->rms_px, 0.16);
  EXPECT_NEAR(opinion->baseline_mm, 83.15, 0.05);
  EXPECT_TRUE(base::Camera::make(opinion->lens, 640, 480, opinion->parameters[0]));
}

TEST(SecondOpinion, FindsTheTwinAndRejectsABlunder) {
  base::Board board = tests::scene_board();
  board.free = false;
  board.prior = {};
  auto scene = tests::make_scene(board, {.seed = 5});
  const auto ours = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  ASSERT_TRUE(ours) << ours.error().message;
  base::Calibration spoiled = *ours;
  spoiled.residuals[17].measured_px.x() += 3.0;
  const auto opinion = second_opinion(spoiled, {.lens = base::LensModel::kOpenCv5, .reject_outliers = true});
  ASSERT_TRUE(opinion) << opinion.error().message;
  EXPECT_GE(opinion->rejected, 1);
  EXPECT_LT(opinion->rejected, 10);
  EXPECT_NEAR(opinion->baseline_mm, scene.cameras[1].translation.norm(), 4.0 * ours->rig->baseline_sigma_mm);
  for (const double difference : opinion->difference_rms_px) EXPECT_LT(difference, 0.02);
  EXPECT_NEAR(opinion->rms_px, 0.05 * std::sqrt(2.0), 0.004);
}

TEST(SecondOpinion, RefusesWithAReason) {
  base::Board board = tests::scene_board();
  board.free = false;
  const auto scene = tests::make_scene(board, {.stations = 6, .two_cameras = false});
  auto good = calibrate(scene.views, {.lens = base::LensModel::kOpenCv4, .cross_validate = false});
  ASSERT_TRUE(good) << good.error().message;
  EXPECT_TRUE(second_opinion(*good));
  EXPECT_EQ(second_opinion(*good, {.lens = base::LensModel::kAicon}).error().code, base::ErrorCode::kUsage);
  base::Calibration other = *good;
  other.board.board.pattern = base::BoardPattern::kAprilGrid;
  EXPECT_THAT(second_opinion(other).error().message, testing::HasSubstr("square grids"));
  other = *good;
  other.residuals.clear();
  EXPECT_EQ(second_opinion(other).error().code, base::ErrorCode::kBadInput);
  other = *good;
  other.residuals[3].measured_px.y() = std::nan("");
  const auto broken = second_opinion(other);
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error().message, testing::HasSubstr("finite"));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(second_opinion(*good, {}, {.report = {}, .stop = stop.get_token()}).error().code, base::ErrorCode::kCancelled);
}

}  // namespace
}  // namespace crosstie::calib
