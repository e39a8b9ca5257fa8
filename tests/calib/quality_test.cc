// Pairs of images against the epipolar geometry, maps at the working distance, and the change since an earlier calibration.
#include "calib/quality.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "math/distributions.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

/// `bent` is the change of k1 of both lenses: radial, with the third power of the tangent.
base::Calibration calibrated(std::uint64_t seed, double bent = 0.0) {
  auto scene = tests::make_scene(tests::scene_board(), {.seed = seed});
  for (base::BoardImage& image : scene.views.images) {
    const tests::TrueCamera& camera = scene.cameras[image.camera == "left" ? 0 : 1];
    const Eigen::Vector2d middle(camera.lens[2], camera.lens[3]);
    for (base::BoardCorner& corner : image.corners) {
      const Eigen::Vector2d tangent = (corner.px - middle) / camera.lens[0];
      corner.px += bent * tangent.squaredNorm() * (corner.px - middle);
    }
  }
  auto result = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  EXPECT_TRUE(result) << result.error().message;
  return *std::move(result);
}

TEST(CalibrationQuality, PairsKeepToTheEpipolarCurvesAsTheirCornersAllow) {
  base::Calibration calibration = calibrated(3);
  const auto pairs = epipolar_pairs(calibration);
  ASSERT_EQ(pairs.size(), calibration.stations.size());
  double squares = 0.0;
  double expected = 0.0;
  int corners = 0;
  for (const base::EpipolarPair& pair : pairs) {
    EXPECT_NEAR(pair.rms_px / pair.expected_px, 1.0, 0.5) << pair.station;
    EXPECT_GE(pair.max_px, pair.rms_px);
    squares += pair.corners * pair.rms_px * pair.rms_px;
    expected += pair.corners * pair.expected_px * pair.expected_px;
    corners += pair.corners;
  }
  // The noise that was drawn is 0.05 px; in a pair of like cameras both images' shares are nearly alike.
  EXPECT_NEAR(std::sqrt(expected / corners), 0.05 * std::sqrt(2.0), 0.006);
  EXPECT_NEAR(std::sqrt(squares / expected), 1.0, 3.3 / std::sqrt(2.0 * corners) + 0.02);  // some unknowns follow the noise

  // One pair whose right image was taken later: the board had moved by 0.4 px across the epipolar lines, which run along the rows.
  for (base::CalibrationResidual& one : calibration.residuals) {
    const base::CalibratedView& view = calibration.views[static_cast<std::size_t>(one.view)];
    if (view.camera == "right" && view.station == 5) one.measured_px.y() += 0.4;
  }
  const auto moved = epipolar_pairs(calibration);
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (moved[i].station == calibration.stations[5].name) {
      EXPECT_NEAR(std::abs(moved[i].mean_px - pairs[i].mean_px), 0.4, 0.03);
      EXPECT_GT(moved[i].rms_px, 4.0 * moved[i].expected_px);
    } else {
      EXPECT_EQ(moved[i].rms_px, pairs[i].rms_px);
    }
  }
}

TEST(CalibrationQuality, MapsStandAtTheWorkingDistance) {
  const base::Calibration calibration = calibrated(4);
  const double distance_mm = working_distance_mm(calibration);
  EXPECT_NEAR(distance_mm, 1300.0, 150.0);  // where the scene holds its boards
  const auto maps = calibration_maps(calibration, distance_mm);
  ASSERT_TRUE(maps) << maps.error().message;
  ASSERT_EQ(maps->cameras.size(), 2U);
  ASSERT_TRUE(maps->in_rig && maps->on_boards);
  const auto px = base::map_figures(maps->cameras[0].sigma_px, maps->cameras[0].calibrated);
  const auto mm = base::map_figures(maps->cameras[0].sigma_mm, maps->cameras[0].calibrated);
  EXPECT_NEAR(mm.median / px.median, distance_mm / 1500.0, 0.2);
  EXPECT_LE(px.median, px.p95);
  EXPECT_LE(px.p95, px.max);
  base::Calibration alone = calibration;
  alone.rig.reset();
  EXPECT_FALSE(calibration_maps(alone, distance_mm)->in_rig);
  EXPECT_TRUE(epipolar_pairs(alone).empty());
  alone.covariance = {};
  EXPECT_FALSE(calibration_maps(alone, distance_mm));
}

// Boards and noise are drawn anew for each calibration: what two of them differ by must be what they predict.
TEST(CalibrationQuality, ChangesOfAHeadThatDidNotChangeAreWhatTheirSigmasSay) {
  constexpr int kPairs = 12;
  double squares = 0.0;
  int exceeded = 0;
  std::array<double, 2> log_p = {};
  for (int i = 0; i < kPairs; ++i) {
    const auto seed = static_cast<std::uint64_t>(500 + 2 * i);
    const auto change = calibration_change(calibrated(seed), calibrated(seed + 1), 1300.0);
    ASSERT_TRUE(change.rig);
    squares += std::pow(change.rig->baseline_change_mm / change.rig->baseline_sigma_mm, 2);
    ASSERT_EQ(change.cameras.size(), 2U);
    for (std::size_t c = 0; c < 2; ++c) {
      const auto& lens = change.cameras[c];
      ASSERT_TRUE(lens.difference && lens.difference->test) << lens.failure;
      exceeded += lens.difference->test->exceeded() ? 1 : 0;
      log_p[c] -= 2.0 * std::log(lens.difference->test->p);
    }
  }
  EXPECT_GT(squares, math::chi_square_quantile(0.0005, kPairs));
  EXPECT_LT(squares, math::chi_square_quantile(0.9995, kPairs));
  EXPECT_LE(exceeded, 1);
  // Fisher: of independent uniform p the sum of -2 log p is a chi-square variable with twice as many degrees.
  for (const double sum : log_p) {
    EXPECT_GT(sum, math::chi_square_quantile(0.0005, 2.0 * kPairs));
    EXPECT_LT(sum, math::chi_square_quantile(0.9995, 2.0 * kPairs));
  }
}

// A longer focal length would not be: at one distance a shift of the frame along the axis does the same.
TEST(CalibrationQuality, ALensThatChangedIsSeen) {
  const auto change = calibration_change(calibrated(700), calibrated(701, 0.01), 1300.0);
  for (const auto& lens : change.cameras) {
    ASSERT_TRUE(lens.difference && lens.difference->test) << lens.failure;
    EXPECT_TRUE(lens.difference->test->exceeded()) << lens.name;
  }
  base::Calibration other = calibrated(702);
  other.cameras[0].name = "hand";
  const auto partly = calibration_change(other, calibrated(703), 1300.0);
  ASSERT_EQ(partly.cameras.size(), 1U);
  EXPECT_EQ(partly.cameras[0].name, "right");
}

}  // namespace
}  // namespace crosstie::calib
