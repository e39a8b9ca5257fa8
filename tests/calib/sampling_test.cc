// The headline of the calibration: its covariance is true. A hundred boards are drawn from the prior and photographed with noise; the
// errors of lenses, rig and projected points must have the covariance that is stated.
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "calib/calibrate.h"
#include "math/distributions.h"
#include "tests/calib/true_boards.h"

namespace crosstie::calib {
namespace {

constexpr int kSeeds = 100;

/// Sums of normalised squares, with their degrees of freedom.
struct ChiSquare {
  double sum = 0.0;
  int dof = 0;

  void add(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
    const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
    const Eigen::MatrixXd correlation = sigma.cwiseInverse().asDiagonal() * covariance * sigma.cwiseInverse().asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd> llt(correlation);
    ASSERT_EQ(llt.info(), Eigen::Success);
    const Eigen::VectorXd scaled = error.cwiseQuotient(sigma);
    sum += scaled.dot(llt.solve(scaled));
    dof += static_cast<int>(error.size());
  }
  void expect_true(const char* what) const {
    EXPECT_GT(sum, math::chi_square_quantile(0.0005, dof)) << what << " " << sum / dof;
    EXPECT_LT(sum, math::chi_square_quantile(0.9995, dof)) << what << " " << sum / dof;
  }
};

/// Of a point in the rig's frame: predicted minus true pixel, and its derivatives by the unknowns of the joint covariance.
struct Projected {
  Eigen::Vector2d error;
  Eigen::MatrixXd jacobian;
};

Projected project_point(const tests::TrueScene& scene, const base::Calibration& result, std::size_t c,
                        const Eigen::Vector3d& p_in_rig) {
  const auto& camera = result.cameras[c].camera;
  const auto count = camera.parameters().size();
  const bool right = c == 1;
  const base::Pose camera_from_rig = right ? result.rig->right_from_left : base::Pose{};
  const Eigen::Vector3d p_in_camera = camera_from_rig * p_in_rig;
  Eigen::Matrix<double, 2, 3> d_point;
  base::ProjectionParameterJacobian d_lens;
  const auto pixel = camera.project(p_in_camera, &d_point, &d_lens);
  EXPECT_TRUE(pixel);
  const auto& truth = scene.cameras[c];
  Projected projected;
  projected.error = *pixel - truth.project(truth.rotation * p_in_rig + truth.translation);
  projected.jacobian = Eigen::MatrixXd::Zero(2, result.covariance.cols());
  projected.jacobian.middleCols(static_cast<Eigen::Index>(c) * count, count) = d_lens;
  if (right) {
    Eigen::Matrix<double, 3, 6> by_pose;  // of exp(w, v) applied on the left
    by_pose << -base::skew(p_in_camera), Eigen::Matrix3d::Identity();
    projected.jacobian.middleCols(2 * count, 6) = d_point * by_pose;
  }
  return projected;
}

TEST(CalibrationSampling, CovarianceOfLensesRigAndProjectionsIsTrue) {
  ChiSquare lenses;
  ChiSquare rig;
  ChiSquare together;
  ChiSquare points;
  ChiSquare baseline;
  double errors = 0.0;
  double predicted = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto scene = tests::make_scene(tests::scene_board(), {.seed = static_cast<std::uint64_t>(seed)});
    const auto result = calibrate(scene.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_TRUE(result->rig);
    Eigen::VectorXd error(24);
    for (std::size_t c = 0; c < 2; ++c) {
      error.segment<9>(static_cast<Eigen::Index>(9 * c)) =
          Eigen::Map<const Eigen::VectorXd>(scene.cameras[c].lens.data(), 9) - result->cameras[c].camera.parameters();
    }
    const base::Pose truth{Eigen::Quaterniond(scene.cameras[1].rotation), scene.cameras[1].translation};
    error.tail<6>() = base::difference(result->rig->right_from_left, truth);
    const Eigen::MatrixXd cov = result->covariance.topLeftCorner<24, 24>();
    ASSERT_EQ(result->labels[0], "camera left fx [px]");
    ASSERT_EQ(result->labels[9], "camera right fx [px]");
    ASSERT_EQ(result->labels[18], "rig rx [rad]");
    lenses.add(error.head<18>(), cov.topLeftCorner<18, 18>());
    rig.add(error.tail<6>(), cov.bottomRightCorner<6, 6>());
    rig.add(error.tail<6>(), result->rig->cov);
    together.add(error, cov);
    const double gap = truth.translation_mm.norm() - result->rig->baseline_mm;
    baseline.add(Eigen::VectorXd::Constant(1, gap),
                 Eigen::MatrixXd::Constant(1, 1, std::pow(result->rig->baseline_sigma_mm, 2)));
    // One point as both cameras see it, another one for each seed; then a grid for the mean sigma.
    const double place = static_cast<double>(seed) / kSeeds - 0.5;
    const Eigen::Vector3d p_in_rig(190.0 + 600.0 * place, 250.0 * std::sin(9.0 * place), 1300.0);
    Eigen::Vector4d error_px;
    Eigen::MatrixXd jacobian(4, result->covariance.cols());
    for (std::size_t c = 0; c < 2; ++c) {
      const auto one = project_point(scene, *result, c, p_in_rig);
      error_px.segment<2>(static_cast<Eigen::Index>(2 * c)) = one.error;
      jacobian.middleRows<2>(static_cast<Eigen::Index>(2 * c)) = one.jacobian;
      for (int i = -3; i <= 3; ++i) {
        for (int j = -2; j <= 2; ++j) {
          const auto at = project_point(scene, *result, c, {190.0 + 100.0 * i, 120.0 * j, 1300.0});
          errors += at.error.squaredNorm();
          predicted += (at.jacobian * result->covariance * at.jacobian.transpose()).trace();
        }
      }
    }
    points.add(error_px, jacobian * result->covariance * jacobian.transpose());
  }
  rig.dof /= 2;  // the same six twice, from the joint matrix and from the rig
  rig.sum /= 2.0;
  lenses.expect_true("lenses");
  rig.expect_true("rig");
  together.expect_true("lenses and rig");
  points.expect_true("projected points");
  baseline.expect_true("baseline");
  const double ratio = std::sqrt(errors / predicted);
  EXPECT_GT(ratio, 0.85);
  EXPECT_LT(ratio, 1.15);
  RecordProperty("projection_ratio", std::to_string(ratio));
}

}  // namespace
}  // namespace crosstie::calib
