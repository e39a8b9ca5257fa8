// What goes wrong with boards and images in practice: found, named, and either mended or refused.
#include <algorithm>

#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "calib/compare_corners.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

const CalibrateOptions kQuick{.lens = base::LensModel::kOpenCv5, .cross_validate = false};

bool warned(const base::Calibration& result, std::string_view code, std::string_view subject = {}) {
  return std::any_of(result.warnings.begin(), result.warnings.end(), [&](const base::Warning& warning) {
    return warning.code == code && warning.subject.find(subject) != std::string::npos;
  });
}

bool says(const base::Error& error, std::string_view words) { return error.message.find(words) != std::string::npos; }

tests::TrueScene good_scene(tests::SceneOptions options = {}) { return tests::make_scene(tests::scene_board(), options); }

/// Within five sigmas of the true focal lengths and, where there is a rig, of the true baseline.
void expect_near_truth(const tests::TrueScene& scene, const base::Calibration& result) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const auto& camera = result.cameras[c].camera;
    EXPECT_LT(std::abs(camera.parameters()(0) - scene.cameras[c].lens[0]), 5.0 * std::sqrt(camera.covariance()(0, 0)));
  }
  if (result.rig) {
    EXPECT_LT(std::abs(result.rig->baseline_mm - scene.cameras[1].translation.norm()), 5.0 * result.rig->baseline_sigma_mm);
  }
}

TEST(DamagedViews, BlundersLeaveWithTheirName) {
  auto scene = good_scene();
  scene.views.images[3].corners[10].px += Eigen::Vector2d(3.0, 0.0);
  scene.views.images[8].corners[20].px += Eigen::Vector2d(0.0, -0.6);
  scene.views.images[9].corners[0].px += Eigen::Vector2d(400.0, 300.0);
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  expect_near_truth(scene, *result);
  ASSERT_EQ(result->rejected.size(), 3U);
  EXPECT_NEAR(result->sigma0_px, 0.05, 0.004);
  for (const std::size_t i : {3U, 8U, 9U}) {
    EXPECT_TRUE(std::any_of(result->rejected.begin(), result->rejected.end(),
                            [&](const auto& rejected) { return rejected.image == scene.views.images[i].image; }));
  }
}

TEST(DamagedViews, AnImageWhoseCornersAreAnotherBoardsLeavesAsAWhole) {
  auto scene = good_scene();
  auto& bad = scene.views.images[6];
  for (auto& corner : bad.corners)
    corner.px += 4.0 * Eigen::Vector2d(std::sin(7.0 * corner.index), std::cos(5.0 * corner.index));
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  expect_near_truth(scene, *result);
  EXPECT_TRUE(warned(*result, "image_left_out", bad.image));
  EXPECT_TRUE(std::any_of(result->rejected.begin(), result->rejected.end(),
                          [&](const auto& rejected) { return rejected.image == bad.image && rejected.corner == -1; }));
}

TEST(DamagedViews, CornersCountedFromTheOtherEndAreTurnedRound) {
  auto scene = good_scene();
  const auto good = calibrate(scene.views, kQuick);
  ASSERT_TRUE(good) << good.error().message;
  for (const std::size_t i : {3U, 8U, 9U}) {  // a right image, then both of a station
    for (auto& corner : scene.views.images[i].corners) corner.index = scene.board.count() - 1 - corner.index;
  }
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  for (const std::size_t i : {3U, 8U, 9U}) EXPECT_TRUE(warned(*result, "corners_turned", scene.views.images[i].image));
  EXPECT_NEAR(result->cameras[0].camera.parameters()(0), good->cameras[0].camera.parameters()(0), 1e-5);
  EXPECT_NEAR(result->rig->baseline_mm, good->rig->baseline_mm, 1e-5);
}

TEST(DamagedViews, ColumnsAndRowsExchangedAreRefusedByName) {
  auto scene = good_scene();
  std::swap(scene.views.board.columns, scene.views.board.rows);
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_FALSE(result);
  EXPECT_TRUE(says(result.error(), "exchanged")) << result.error().message;
}

TEST(DamagedViews, AnotherBoardIsRefused) {
  auto scene = good_scene();
  scene.views.board.columns = 7;
  scene.views.board.rows = 10;
  for (auto& image : scene.views.images) std::erase_if(image.corners, [](const auto& corner) { return corner.index % 3 == 0; });
  scene.views.board.columns = 5;
  scene.views.board.rows = 14;
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_FALSE(result);
  EXPECT_TRUE(says(result.error(), "another one")) << result.error().message;
}

TEST(DamagedViews, AFrontalBoardIsRefused) {
  const auto scene = good_scene({.tilt_rad = 0.005});
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_TRUE(says(result.error(), "Tilt")) << result.error().message;
}

TEST(DamagedViews, LittleTiltIsAWarningWithAHonestSigma) {
  const auto scene = good_scene({.tilt_rad = 0.12, .roll = false});
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "little_tilt", "left"));
  EXPECT_TRUE(warned(*result, "not_rolled", "left"));
  const auto& camera = result->cameras[0].camera;
  EXPECT_LT(std::abs(camera.parameters()(0) - 1500.0), 5.0 * std::sqrt(camera.covariance()(0, 0)));
}

TEST(DamagedViews, TooFewImagesAreRefused) {
  auto scene = good_scene({.stations = 2});
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_TRUE(says(result.error(), "at least 3")) << result.error().message;
}

TEST(DamagedViews, FewImagesAreAWarningAndNotValidated) {
  const auto scene = good_scene({.stations = 4});
  CalibrateOptions options = kQuick;
  options.cross_validate = true;
  const auto result = calibrate(scene.views, options);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "few_views", "left"));
  EXPECT_TRUE(warned(*result, "not_validated"));
}

TEST(DamagedViews, ThePitchInInchesIsFoundByTheExpectedBaseline) {
  auto scene = good_scene();
  const double truth = scene.cameras[1].translation.norm();
  CalibrateOptions options = kQuick;
  options.expected_baseline_mm = truth + 5.0;
  ASSERT_TRUE(calibrate(scene.views, options));
  scene.views.board.pitch_mm /= 25.4;
  const auto result = calibrate(scene.views, options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_TRUE(says(result.error(), "inches")) << result.error().message;
}

TEST(DamagedViews, SwappedCamerasAreNamed) {
  auto scene = good_scene();
  for (auto& image : scene.views.images) image.camera = image.camera == "left" ? "right" : "left";
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "cameras_swapped"));
  EXPECT_FALSE(warned(*calibrate(good_scene().views, kQuick), "cameras_swapped"));
}

TEST(DamagedViews, PairsOfDifferentMomentsAreRefusedOrTakenApart) {
  auto scene = good_scene();
  auto shifted = scene.views;
  for (std::size_t i = 1; i + 2 < shifted.images.size(); i += 2) shifted.images[i].corners = scene.views.images[i + 2].corners;
  const auto refused = calibrate(shifted, kQuick);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(says(refused.error(), "same moment")) << refused.error().message;
  // One pair only: its images take part alone.
  auto one = scene.views;
  std::swap(one.images[1].corners, one.images[7].corners);
  const auto result = calibrate(one, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "pair_contradicts_rig", one.images[1].image));
  EXPECT_TRUE(warned(*result, "pair_contradicts_rig", one.images[7].image));
  EXPECT_EQ(result->rig->stations, 14);
  expect_near_truth(scene, *result);
}

TEST(DamagedViews, UnpairedImagesTakePartAlone) {
  auto scene = good_scene();
  scene.views.images.erase(scene.views.images.begin() + 5);
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "unpaired_images", "102"));
  EXPECT_EQ(result->rig->stations, 15);
  EXPECT_EQ(result->cameras[0].views, 16);
  EXPECT_EQ(result->cameras[1].views, 15);
  expect_near_truth(scene, *result);
}

TEST(DamagedViews, CamerasWithoutACommonMomentHaveNoRig) {
  auto scene = good_scene();
  for (auto& image : scene.views.images) {
    if (image.camera == "right") image.image = "right" + std::to_string(500 + std::stoi(image.image.substr(5)));
  }
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->rig);
  EXPECT_TRUE(warned(*result, "no_pairs"));
}

TEST(DamagedViews, TheSamePhotographTwiceCountsOnce) {
  auto scene = good_scene();
  auto again = scene.views.images[4];
  again.image = "left900";
  scene.views.images.push_back(again);
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "image_left_out", "left900"));
  EXPECT_EQ(result->cameras[0].views, 16);
}

TEST(DamagedViews, AnUncoveredImageIsNamedAndNotCalibrated) {
  const auto scene = good_scene();
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result);
  EXPECT_TRUE(warned(*result, "poor_coverage", "left"));
  EXPECT_FALSE(result->cameras[0].area.contains({3.0, 3.0}));
  EXPECT_TRUE(result->cameras[0].area.contains({960.0, 600.0}));
  const auto& camera = result->cameras[0].camera;
  ASSERT_TRUE(camera.valid_region_px());
  EXPECT_FALSE(camera.calibrated_at({3.0, 3.0}));
  EXPECT_TRUE(camera.calibrated_at({960.0, 600.0}));
  for (const auto& residual : result->residuals) {  // what was seen lies inside, but for its outermost corners
    if (result->views[static_cast<std::size_t>(residual.view)].camera != "left") continue;
    const Eigen::Vector2d inwards = 0.01 * (Eigen::Vector2d(960.0, 600.0) - residual.measured_px).normalized();
    EXPECT_TRUE(camera.calibrated_at(residual.measured_px + inwards));
  }
}

TEST(DamagedViews, ABoardThatIsWorseThanItsPriorIsNamed) {
  auto scene = good_scene();
  scene.views.board.prior = {0.005, 0.01, 20.0};
  const auto result = calibrate(scene.views, kQuick);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warned(*result, "board_prior_too_tight"));
  EXPECT_GT(result->board.prior_ratio, 3.0);
}

TEST(DamagedViews, InconsistentInputIsRefused) {
  const auto refused = [](auto change, std::string_view words) {
    auto scene = good_scene();
    change(scene.views);
    const auto result = calibrate(scene.views, kQuick);
    EXPECT_FALSE(result) << words;
    if (!result) {
      EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput) << result.error().message;
      EXPECT_TRUE(says(result.error(), words)) << result.error().message;
    }
  };
  refused([](BoardViews& v) { v.images[2].corners[3].index = 70; }, "not on a board");
  refused([](BoardViews& v) { v.images[2].corners[3].index = 4; }, "twice");
  refused([](BoardViews& v) { v.images[2].corners[3].px.x() = std::nan(""); }, "finite");
  refused([](BoardViews& v) { v.images[2].corners[3].px.x() = 1e9; }, "far outside");
  refused([](BoardViews& v) { v.images[2].corners[3].sigma_px = 0.1; }, "sigma");
  refused([](BoardViews& v) { v.images[2].corners[3].sigma_px = -0.1; }, "sigma");
  refused([](BoardViews& v) { v.images[2].camera = "middle"; }, "no camera middle");
  refused([](BoardViews& v) { v.images[2].width_px = 1000; }, "pixels");
  refused([](BoardViews& v) { v.images[2].width_px = 0; }, "size");
  refused([](BoardViews& v) { v.images[2].image = v.images[4].image; }, "twice");
  refused([](BoardViews& v) { v.images[2].image = "left0104"; }, "same number");
  refused([](BoardViews& v) { v.cameras.clear(); }, "cameras");
  refused([](BoardViews& v) { v.cameras[1] = "left"; }, "different names");
  refused([](BoardViews& v) { v.board.pitch_mm = -1.0; }, "pitch");
}

TEST(DamagedViews, ComputedCornersWithoutNoiseAreNoObstacle) {
  for (const bool free : {false, true}) {
    base::Board board = tests::scene_board();
    board.free = free;
    const auto scene = tests::make_scene(board, {.stations = 8, .sigma_px = 0.0});
    const auto result = calibrate(scene.views, kQuick);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_TRUE(result->rejected.empty());
    EXPECT_LT(result->rms_px, 1e-4);
    EXPECT_NEAR(result->cameras[0].camera.parameters()(0), 1500.0, 1e-2);
  }
}

TEST(DamagedViews, OptionsAreHeldToTheirDomain) {
  const auto scene = good_scene();
  const auto refused = [&](auto change) {
    CalibrateOptions options = kQuick;
    change(options);
    const auto result = calibrate(scene.views, options);
    return !result && result.error().code == base::ErrorCode::kUsage;
  };
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.sigma_px = 0.0; }));
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.folds = 1; }));
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.significance = 1.0; }));
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.expected_baseline_mm = -5.0; }));
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.threads = -1; }));
  EXPECT_TRUE(refused([](CalibrateOptions& o) { o.lens = base::LensModel::kAicon; }));
}

TEST(DamagedViews, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  base::Progress progress;
  progress.stop = source.get_token();
  const auto result = calibrate(good_scene().views, kQuick, progress);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kCancelled);
}

TEST(DamagedViews, CornersOfAnotherDetectorAreComparedInEitherOrder) {
  const auto scene = good_scene();
  BoardViews other = scene.views;
  for (auto& image : other.images) {
    for (auto& corner : image.corners) corner.px += Eigen::Vector2d(0.03, 0.04);
  }
  for (auto& corner : other.images[5].corners) corner.index = scene.board.count() - 1 - corner.index;
  const auto trial = compare_corners("sb", other, scene.views, base::LensModel::kOpenCv5);
  EXPECT_TRUE(trial.failure.empty()) << trial.failure;
  EXPECT_NEAR(trial.difference_px, 0.05, 1e-6);
  EXPECT_EQ(trial.images, 32);
  EXPECT_NEAR(trial.baseline_mm, scene.cameras[1].translation.norm(), 1.0);
}

}  // namespace
}  // namespace crosstie::calib
