#include "math/projection_difference.h"

#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "math/distributions.h"
#include "tests/support/synthetic_calibration.h"

namespace crosstie::math {
namespace {

using base::Camera;
using base::ErrorCode;

constexpr int kWidth = 1280;
constexpr int kHeight = 1024;

Camera camera(base::LensModel model, const std::vector<double>& parameters) {
  return *Camera::make(model, kWidth, kHeight,
                       Eigen::Map<const Eigen::VectorXd>(parameters.data(), static_cast<Eigen::Index>(parameters.size())));
}

Camera pinhole(double focal_px, double cx_px, double cy_px) {
  return camera(base::LensModel::kPinhole, {focal_px, focal_px, cx_px, cy_px});
}

TEST(ProjectionDifference, IsNothingBetweenAModelAndItself) {
  const Camera a = tests::calibrated_camera(0.0);
  const auto same = projection_difference(a, a);
  ASSERT_TRUE(same) << same.error().message;
  EXPECT_LT(same->max_px, 1e-8);
  EXPECT_LT(same->max_before_px, 1e-8);
  EXPECT_LT(base::rotation_log(same->b_from_a.rotation).norm(), 1e-12);
  ASSERT_TRUE(same->test);
  EXPECT_GT(same->test->p, 0.999);
  EXPECT_EQ(same->cells, same->grid.count());
}

// Principal points 12 px apart: a turn by 12 / f hides it but for the squares of the tangents.
TEST(ProjectionDifference, FindsAMotionThatIsTheWholeDifference) {
  const Camera a = pinhole(1500.0, 639.5, 511.5);
  const Camera b = pinhole(1500.0, 651.5, 511.5);
  const auto turned = projection_difference(a, b, {.columns = 20});
  ASSERT_TRUE(turned) << turned.error().message;
  EXPECT_NEAR(turned->rms_before_px, 12.0, 1e-9);
  EXPECT_NEAR(turned->max_before_px, 12.0, 1e-9);
  // A turn of a about y by -12 / f shifts its picture by f tan: what remains are the squares of the tangent.
  EXPECT_NEAR(base::rotation_log(turned->b_from_a.rotation).y(), -12.0 / 1500.0, 0.1 * 12.0 / 1500.0);
  EXPECT_LT(turned->rms_px, 0.1 * 12.0);
  EXPECT_EQ(turned->b_from_a.translation_mm.norm(), 0.0);
  // At a finite distance the frame may also be shifted: 12 px are 12 * d / f to the side, in the middle of the image.
  const auto shifted = projection_difference(a, b, {.distance_mm = 1000.0, .columns = 20});
  ASSERT_TRUE(shifted) << shifted.error().message;
  EXPECT_LT(shifted->rms_px, turned->rms_px);
}

// Numbers of mrcal 2.2 for these two models on the same cells (python3-mrcal, double precision):
//   q = middles of 20 x 16 cells;  va = mrcal.unproject(q, *a.intrinsics(), normalize=True);  vb likewise
//   Rt = mrcal.implied_Rt10__from_unprojections(q, va * d, vb, weights=None, atinfinity=..., focus_center=(639.5, 511.5), focus_radius=1e9)
//   d = mrcal.project(mrcal.transform_point_Rt(Rt, va * d), *b.intrinsics()) - q,  which is what mrcal.projection_diff does.
TEST(ProjectionDifference, IsThatOfMrcal) {
  const Camera a = camera(base::LensModel::kOpenCv5, {1053.2, 1053.0, 639.1, 513.7, -0.0912, 0.1134, 2.1e-4, -3.9e-4, -0.021});
  const Camera b = camera(base::LensModel::kOpenCv8,
                          {1055.9, 1055.8, 645.3, 509.9, -0.0880, 0.1021, 1.7e-4, -2.9e-4, -0.015, 0.0020, -0.0030, 0.0010});
  const auto far = projection_difference(a, b, {.columns = 20});
  ASSERT_TRUE(far) << far.error().message;
  ASSERT_EQ(far->cells, 320);
  struct Recorded {
    int cell;
    double dx_px, dy_px;
  };
  for (const Recorded& one : {Recorded{0, 5.40787161426897, -4.5452720731697696},
                              {7, 5.834043588870202, -5.038413067656563},
                              {170, 6.283439416619217, -3.720655376557829},
                              {250, 6.292038634617484, -3.0343981829473705},
                              {319, 7.215755429748697, -3.0266792745594557}}) {
    EXPECT_NEAR(far->before_px(0, one.cell), one.dx_px, 1e-8) << one.cell;
    EXPECT_NEAR(far->before_px(1, one.cell), one.dy_px, 1e-8) << one.cell;
  }
  EXPECT_NEAR(far->rms_before_px, 7.405977077502178, 1e-8);
  EXPECT_NEAR(far->max_before_px, 8.74849860516414, 1e-8);
  // mrcal fits the angles between rays, we the pixels: ours is the least rms in px by definition. Given our motion (b_from_a of the result,
  // in metres) mrcal's formula gives our field.
  const auto expect_field = [](const base::ProjectionDifference& ours, const std::vector<Recorded>& field, double rms_px,
                               double max_px, double rms_of_its_own_fit_px) {
    for (const Recorded& one : field) {
      EXPECT_NEAR(ours.difference_px(0, one.cell), one.dx_px, 1e-7) << one.cell;
      EXPECT_NEAR(ours.difference_px(1, one.cell), one.dy_px, 1e-7) << one.cell;
    }
    EXPECT_NEAR(ours.rms_px, rms_px, 1e-7);
    EXPECT_NEAR(ours.max_px, max_px, 1e-7);
    EXPECT_LE(ours.rms_px, rms_of_its_own_fit_px);
  };
  expect_field(*far,
               {{0, -1.0510544369579975, -1.8320718553404731},
                {170, 0.7077072722884168, -0.16027445259157957},
                {319, 0.7951362012140635, -0.30174978305672084}},
               1.3977682114159575, 4.07076395527952, 1.410936813112903);
  const auto near = projection_difference(a, b, {.distance_mm = 1300.0, .columns = 20});
  ASSERT_TRUE(near) << near.error().message;
  expect_field(*near,
               {{0, -0.014522744916803276, 1.0263846428734382},
                {170, 0.40862617426682846, -0.23376170911001282},
                {319, -1.3262252474935394, 0.07772946691079596}},
               0.39109199173146597, 1.8894837311114674, 0.4096068206541225);
}

TEST(ProjectionDifference, RefusesWhatCannotBeCompared) {
  const Camera a = tests::calibrated_camera(0.0);
  const auto code = [](const auto& result) { return result ? std::optional<ErrorCode>() : result.error().code; };
  EXPECT_EQ(code(projection_difference(a, *Camera::nominal(base::LensModel::kOpenCv5, 640, 512, 600.0))), ErrorCode::kBadInput);
  EXPECT_EQ(code(projection_difference(a, a, {.distance_mm = -1.0})), ErrorCode::kUsage);
  EXPECT_EQ(code(projection_difference(a, a, {.columns = 3})), ErrorCode::kUsage);
  EXPECT_EQ(code(projection_difference(a, a, {.radius_px = std::nan("")})), ErrorCode::kUsage);
  EXPECT_EQ(code(projection_difference(a, a, {.significance = 0.0})), ErrorCode::kUsage);
  EXPECT_EQ(code(projection_difference(a, a, {.radius_px = 40.0})), ErrorCode::kNoUniqueSolution);
  Camera left = a;
  left.set_valid_region(Camera::Region{{0, 0}, {300, 0}, {300, 1023}, {0, 1023}});
  Camera right = a;
  right.set_valid_region(Camera::Region{{900, 0}, {1279, 0}, {1279, 1023}, {900, 1023}});
  EXPECT_EQ(code(projection_difference(left, right)), ErrorCode::kNoUniqueSolution);
}

TEST(ProjectionDifference, CountsOnlyWhereBothAreCalibrated) {
  Camera a = tests::calibrated_camera(0.0);
  const Camera b = tests::calibrated_camera(2.0);
  const auto whole = projection_difference(a, b, {.columns = 20});
  a.set_valid_region(Camera::Region{{200, 100}, {1000, 100}, {1000, 900}, {200, 900}});
  const auto inside = projection_difference(a, b, {.columns = 20});
  const auto round = projection_difference(a, b, {.columns = 20, .radius_px = 300.0});
  ASSERT_TRUE(whole && inside && round);
  EXPECT_LT(inside->cells, whole->cells);
  EXPECT_LT(round->cells, inside->cells);
  EXPECT_TRUE(inside->difference_px.col(0).allFinite());  // shown there, too
  EXPECT_FALSE(inside->compared[0]);
  const auto shares = base::quantiles(*inside);
  ASSERT_EQ(shares.size(), 6U);
  EXPECT_NEAR(shares.back().after_px, inside->max_px, 1e-12);
  EXPECT_NEAR(shares.back().before_px, inside->max_before_px, 1e-12);
  for (std::size_t i = 1; i < shares.size(); ++i) EXPECT_GE(shares[i].after_px, shares[i - 1].after_px);
}

/// Both models drawn about one truth from their covariances.
struct Drawn {
  Camera truth = tests::calibrated_camera(0.0);
  Eigen::MatrixXd factor = Eigen::LLT<Eigen::MatrixXd>(truth.covariance()).matrixL();
  std::mt19937_64 random{20};
  std::normal_distribution<double> normal;

  Camera draw() {
    Eigen::VectorXd z(9);
    for (Eigen::Index i = 0; i < 9; ++i) z(i) = normal(random);
    Camera camera = *Camera::make(truth.model(), kWidth, kHeight, truth.parameters() + factor * z);
    camera.set_covariance(truth.covariance());
    return camera;
  }
};

// The test's p must be uniform where both models are the same camera: its sigmas, its effective degrees and its distribution in one.
TEST(ProjectionDifference, PredictsItsOwnSizeBySampling) {
  constexpr int kDraws = 600;
  for (const double distance_mm : {0.0, 1300.0}) {
    Drawn drawn;
    double squares = 0.0;
    double predicted = 0.0;
    int below_half = 0;
    int below_tenth = 0;
    int below_hundredth = 0;
    for (int i = 0; i < kDraws; ++i) {
      const Camera a = drawn.draw();
      const Camera b = drawn.draw();
      const auto result = projection_difference(a, b, {.distance_mm = distance_mm, .columns = 10});
      ASSERT_TRUE(result && result->test);
      squares += result->rms_px * result->rms_px;
      predicted += result->test->rms_sigma_px * result->test->rms_sigma_px;
      below_half += result->test->p < 0.5 ? 1 : 0;
      below_tenth += result->test->p < 0.1 ? 1 : 0;
      below_hundredth += result->test->p < 0.01 ? 1 : 0;
      EXPECT_NEAR(chi_square_quantile(0.5, result->test->degrees), 0.7 * result->test->degrees, 0.4 * result->test->degrees);
    }
    // Binomial bounds of 99.9 %.
    const auto bound = [&](double p) { return 3.3 * std::sqrt(kDraws * p * (1.0 - p)); };
    EXPECT_NEAR(below_half, 0.5 * kDraws, bound(0.5)) << distance_mm;
    EXPECT_NEAR(below_tenth, 0.1 * kDraws, bound(0.1)) << distance_mm;
    EXPECT_NEAR(below_hundredth, 0.01 * kDraws, bound(0.01)) << distance_mm;
    EXPECT_NEAR(squares / predicted, 1.0, 0.2) << distance_mm;
  }
}

TEST(ProjectionDifference, AChangedCameraExceedsThePrediction) {
  Drawn drawn;
  const Camera a = drawn.draw();
  Eigen::VectorXd changed = drawn.draw().parameters();
  changed(0) += 5.0;  // sigma 0.2 px; a turn does not hide it
  changed(1) += 5.0;
  Camera b = *Camera::make(a.model(), kWidth, kHeight, changed);
  b.set_covariance(a.covariance());
  const auto result = projection_difference(a, b, {.columns = 20});
  ASSERT_TRUE(result && result->test);
  EXPECT_TRUE(result->test->exceeded());
  EXPECT_GT(result->rms_px, result->test->limit_px);
  b.set_covariance({});
  const auto unknown = projection_difference(a, b, {.columns = 20});
  ASSERT_TRUE(unknown);
  EXPECT_FALSE(unknown->test);
  EXPECT_EQ(unknown->sigma_px.size(), 0);
}

}  // namespace
}  // namespace crosstie::math
