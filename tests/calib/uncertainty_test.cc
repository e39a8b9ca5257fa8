// Projection and triangulation uncertainty against sampling: boards are drawn and photographed, the calibration is repeated, and the
// scatter of what it predicts must be what it states.
#include "calib/uncertainty.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "base/calibration_reader.h"
#include "calib/calibrate.h"
#include "math/projection_difference.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

constexpr int kSeeds = 40;
constexpr double kDistance_mm = 1300.0;

/// Sum of squared errors over the sum of their predicted variances.
struct Ratio {
  double errors = 0.0;
  double predicted = 0.0;

  void add(double square, double variance) {
    errors += square;
    predicted += variance;
  }
  [[nodiscard]] double sigma_ratio() const { return std::sqrt(errors / predicted); }
};

base::Camera true_camera(const tests::TrueCamera& camera) {
  auto made = *base::Camera::make(base::LensModel::kOpenCv5, camera.width, camera.height,
                                  Eigen::Map<const Eigen::VectorXd>(camera.lens.data(), 9));
  made.set_covariance(Eigen::MatrixXd::Zero(9, 9));
  return made;
}

/// Where the calibration believes a point to be that stands at p (left camera) against the true boards.
Eigen::Vector3d by_boards(const tests::TrueScene& scene, const base::Calibration& result, const Eigen::Vector3d& p) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t s = 0; s < result.stations.size(); ++s) {
    sum += result.stations[s].board_from_rig.inverse() * (scene.left_from_board[s].inverse() * p);
  }
  return sum / static_cast<double>(result.stations.size());
}

/// The point that the calibrated cameras see at two pixels, by least squares.
Eigen::Vector3d triangulated(const base::Calibration& result, const Eigen::Vector2d& left, const Eigen::Vector2d& right,
                             Eigen::Vector3d p) {
  const Eigen::Matrix3d rotation = result.rig->right_from_left.rotation.toRotationMatrix();
  for (int i = 0; i < 10; ++i) {
    Eigen::Matrix<double, 2, 3> d_left;
    Eigen::Matrix<double, 2, 3> d_right;
    const auto q_left = result.cameras[0].camera.project(p, &d_left);
    const auto q_right = result.cameras[1].camera.project(result.rig->right_from_left * p, &d_right);
    if (!q_left || !q_right) return Eigen::Vector3d::Constant(std::nan(""));
    Eigen::Matrix<double, 4, 3> jacobian;
    jacobian << d_left, d_right * rotation;
    Eigen::Vector4d residual;
    residual << *q_left - left, *q_right - right;
    p -= (jacobian.transpose() * jacobian).ldlt().solve(jacobian.transpose() * residual);
  }
  return p;
}

TEST(Uncertainty, SigmasAreTrueBySampling) {
  Ratio left_px;
  Ratio right_px;
  Ratio implied_px;
  Ratio depth_rig;
  Ratio depth_boards;
  const math::ProjectionSigmasOptions options{.distance_mm = kDistance_mm, .columns = 12};
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto scene = tests::make_scene(tests::scene_board(), {.seed = static_cast<std::uint64_t>(1000 + seed)});
    const auto result = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_EQ(result->stations.size(), scene.left_from_board.size());
    const base::Pose true_right{Eigen::Quaterniond(scene.cameras[1].rotation), scene.cameras[1].translation};
    for (int c = 0; c < 2; ++c) {
      const auto& estimated = result->cameras[static_cast<std::size_t>(c)].camera;
      const base::Camera truth = true_camera(scene.cameras[static_cast<std::size_t>(c)]);
      const base::Pose left_from_camera = c == 0 ? base::Pose{} : true_right.inverse();
      const auto sigmas = projection_sigmas(*result, c, options);
      ASSERT_TRUE(sigmas) << sigmas.error().message;
      int counted = 0;
      for (int i = 0; i < sigmas->grid.count(); ++i) {
        if (!sigmas->calibrated[static_cast<std::size_t>(i)]) continue;
        const Eigen::Vector2d pixel = sigmas->grid.middle_px(i);
        Eigen::Vector3d p = by_boards(scene, *result, left_from_camera * (kDistance_mm * *truth.unproject(pixel)));
        if (c == 1) p = result->rig->right_from_left * p;
        const double variance = std::pow(sigmas->sigma_px(i), 2) + std::pow(sigmas->minor_px(i), 2);
        (c == 0 ? left_px : right_px).add((*estimated.project(p) - pixel).squaredNorm(), variance);
        ++counted;
      }
      EXPECT_GT(counted, 20);
      const auto difference = math::projection_difference(truth, estimated, {.distance_mm = kDistance_mm, .columns = 12});
      ASSERT_TRUE(difference) << difference.error().message;
      ASSERT_TRUE(difference->test);
      implied_px.add(std::pow(difference->rms_px, 2), std::pow(difference->test->rms_sigma_px, 2));
    }
    for (const PointFrame frame : {PointFrame::kRig, PointFrame::kBoards}) {
      const auto sigmas = triangulation_sigmas(*result, frame, options);
      ASSERT_TRUE(sigmas) << sigmas.error().message;
      for (int i = 0; i < sigmas->grid.count(); ++i) {
        if (!sigmas->calibrated[static_cast<std::size_t>(i)]) continue;
        const Eigen::Vector2d pixel = sigmas->grid.middle_px(i);
        const Eigen::Vector3d ray = *true_camera(scene.cameras[0]).unproject(pixel);
        const Eigen::Vector3d p = kDistance_mm * ray;
        const auto right = true_camera(scene.cameras[1]).project(true_right * p);
        if (!right) continue;
        const Eigen::Vector3d found = triangulated(*result, pixel, *right, p);
        const bool rig = frame == PointFrame::kRig;
        const Eigen::Vector3d expected = rig ? p : by_boards(scene, *result, p);
        (rig ? depth_rig : depth_boards).add(std::pow(ray.dot(found - expected), 2), std::pow(sigmas->sigma_depth_mm(i), 2));
      }
    }
  }
  for (const auto& [name, ratio] : {std::pair("left", &left_px),
                                    {"right", &right_px},
                                    {"implied", &implied_px},
                                    {"depth, rig", &depth_rig},
                                    {"depth, boards", &depth_boards}}) {
    EXPECT_GT(ratio->sigma_ratio(), 0.85) << name;
    EXPECT_LT(ratio->sigma_ratio(), 1.15) << name;
    RecordProperty(name, std::to_string(ratio->sigma_ratio()));
  }
}

TEST(Uncertainty, GrowsOutsideOfTheBoardsAndWithTheDistanceAcross) {
  const auto scene = tests::make_scene(tests::scene_board(), {.seed = 7});
  const auto result = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  ASSERT_TRUE(result);
  const auto near = projection_sigmas(*result, 0, {.distance_mm = 1300.0, .columns = 20});
  const auto far = projection_sigmas(*result, 0, {.distance_mm = 5000.0, .columns = 20});
  ASSERT_TRUE(near && far);
  const int middle = near->grid.columns * (near->grid.rows / 2) + near->grid.columns / 2;
  EXPECT_GT(near->sigma_px(0), 2.0 * near->sigma_px(middle));
  EXPECT_GT(far->sigma_px(middle), near->sigma_px(middle));  // beyond the boards the poses' wobble shows
  // A pixel at 1300 mm and f = 1500 px is 0.87 mm wide.
  EXPECT_NEAR(near->sigma_mm(middle) / near->sigma_px(middle), 1300.0 / 1500.0, 0.03);
  const auto infinite = projection_sigmas(*result, 0, {.columns = 20});
  ASSERT_TRUE(infinite);
  EXPECT_TRUE(std::isnan(infinite->sigma_mm(middle)));
  const auto with_noise = triangulation_sigmas(*result, PointFrame::kBoards, {.distance_mm = 1300.0, .sigma_px = 0.1});
  const auto without = triangulation_sigmas(*result, PointFrame::kBoards, {.distance_mm = 1300.0});
  ASSERT_TRUE(with_noise && without);
  const int cell = without->grid.columns * (without->grid.rows / 2) + without->grid.columns / 2;
  EXPECT_GT(with_noise->sigma_mm(cell), without->sigma_mm(cell));
}

TEST(Uncertainty, OfWholeLensesGoesOnToLaterSteps) {
  const auto scene = tests::make_scene(tests::scene_board(), {.seed = 7});
  const auto result = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  ASSERT_TRUE(result) << result.error().message;
  const auto joint = base::joint_covariance(*result, {result->cameras[0].name, result->cameras[1].name}, true);
  ASSERT_TRUE(joint) << joint.error().message;
  ASSERT_EQ(joint->rows(), 24);
  EXPECT_EQ((joint->topLeftCorner<9, 9>()), result->cameras[0].camera.covariance()) << "focal lengths as well as distortion";
  EXPECT_EQ((joint->block<9, 9>(9, 9)), result->cameras[1].camera.covariance());
  EXPECT_GT(joint->diagonal().minCoeff(), 0.0);
}

TEST(Uncertainty, RefusesWithAReason) {
  base::Calibration empty;
  EXPECT_FALSE(projection_sigmas(empty, 0, {}));
  EXPECT_FALSE(triangulation_sigmas(empty, PointFrame::kRig, {.distance_mm = 1000.0}));
  const base::Camera camera = *base::Camera::nominal(base::LensModel::kOpenCv5, 640, 480, 800.0);
  EXPECT_EQ(math::projection_sigmas(camera, Eigen::MatrixXd::Identity(8, 8)).error().code, base::ErrorCode::kUsage);
  EXPECT_EQ(math::projection_sigmas(camera, Eigen::MatrixXd::Identity(9, 9), {.columns = 0}).error().code,
            base::ErrorCode::kUsage);
  base::Camera nowhere = camera;
  nowhere.set_valid_region(base::Camera::Region{});
  EXPECT_EQ(math::projection_sigmas(nowhere, Eigen::MatrixXd::Identity(9, 9)).error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_EQ(math::triangulation_sigmas(camera, camera, {}, Eigen::MatrixXd::Identity(24, 24), {}).error().code,
            base::ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::calib
