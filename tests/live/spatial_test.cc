// Truth: points of a synthetic head whose calibration, place and images are drawn from their covariances; and the twin's rendered cross.

#include "live/spatial.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "fixtures/render.h"
#include "fixtures/scene.h"
#include "fixtures/truth.h"
#include "markers/detect.h"
#include "math/distributions.h"
#include "math/head_point.h"
#include "tests/support/normalised_square.h"

namespace crosstie::live {
namespace {

base::Camera camera(double focal_px, double k1) {
  Eigen::VectorXd parameters = Eigen::VectorXd::Zero(base::parameter_count(base::LensModel::kOpenCv5));
  parameters.head<6>() << focal_px, focal_px + 0.4, 611.0, 513.0, k1, 0.07;
  return *base::Camera::make(base::LensModel::kOpenCv5, 1224, 1024, parameters);
}

/// Symmetric and positive, with correlations: sigmas times (I + a a') times sigmas.
Eigen::MatrixXd correlated(const Eigen::VectorXd& sigma, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd a(sigma.size()), b(sigma.size());
  for (Eigen::Index i = 0; i < a.size(); ++i) a(i) = 0.6 * normal(random), b(i) = 0.6 * normal(random);
  const Eigen::MatrixXd core = Eigen::MatrixXd::Identity(a.size(), a.size()) + a * a.transpose() + b * b.transpose();
  return sigma.asDiagonal() * core * sigma.asDiagonal();
}

base::Head true_head() {
  base::Head head{.left = camera(1060.0, -0.11), .right = camera(1062.0, -0.105), .right_from_left = {}};
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.52, Eigen::Vector3d(0.02, 1.0, 0.01).normalized()));
  head.right_from_left = {turn, -(turn * Eigen::Vector3d(800.0, 4.0, 190.0))};
  return head;
}

Eigen::VectorXd head_sigmas(const base::Head& head) {
  Eigen::VectorXd lens(base::parameter_count(head.left.model()));
  lens << 0.05, 0.05, 0.06, 0.06, 3e-5, 6e-5, 2e-6, 2e-6, 4e-5;
  Eigen::VectorXd all(head.parameter_count());
  all << lens, lens, Eigen::Vector3d::Constant(2e-5), Eigen::Vector3d::Constant(0.03);
  return all;
}

base::Head moved(base::Head head, const Eigen::VectorXd& by) {
  for (Eigen::Index i = 0; i < by.size() - 6; ++i) head = *math::moved_head(head, i, by(i));
  head.right_from_left = base::perturbed(head.right_from_left, base::Vector6d(by.tail<6>()));
  return head;
}

Eigen::VectorXd drawn(const Eigen::MatrixXd& cov, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd z(cov.rows());
  for (double& value : z) value = normal(random);
  return Eigen::LLT<Eigen::MatrixXd>(cov).matrixL() * z;
}

base::Observation observation(int id, const Eigen::Vector2d& px, const Eigen::Matrix2d& cov) {
  return {.id = id, .centre_px = px, .cov_px2 = cov, .margin = 1.0, .status = base::ObservationStatus::kCoded};
}

/// Mean of `count` chi-square values of `dof` degrees each lies within the bounds that only one of 10,000 leaves.
void expect_chi_square(double sum, int count, int dof, const char* what) {
  const double all = static_cast<double>(count) * dof;
  EXPECT_GT(sum / all, math::chi_square_quantile(5e-5, all) / all) << what;
  EXPECT_LT(sum / all, math::chi_square_quantile(1.0 - 5e-5, all) / all) << what;
  std::printf("%s: %.3f (%d)\n", what, sum / all, count);
}

class Sampled : public ::testing::TestWithParam<bool> {};  // whether head, place and list are correlated

TEST_P(Sampled, NormalisedSquaresAreChiSquare) {
  constexpr int kDraws = 1500;
  std::mt19937_64 random(GetParam() ? 11 : 12);
  const base::Head truth = true_head();
  const base::Pose true_pose{Eigen::Quaterniond(Eigen::AngleAxisd(3.1, Eigen::Vector3d(1.0, 0.1, -0.05).normalized())),
                             {1203.0, 502.0, 1551.0}};
  const Eigen::Index n = truth.parameter_count();
  Eigen::VectorXd sigma(n + 9);
  sigma << head_sigmas(truth), Eigen::Vector3d::Constant(3e-5), Eigen::Vector3d::Constant(0.03),
      Eigen::Vector3d::Constant(0.02);
  Eigen::MatrixXd joint = correlated(sigma, random);
  if (!GetParam()) {
    joint.block(0, n, n, 9).setZero(), joint.block(n, 0, 9, n).setZero();
    joint.block<6, 3>(n, n + 6).setZero(), joint.block<3, 6>(n + 6, n).setZero();
  }
  Eigen::Matrix2d noise_left, noise_right;
  noise_left << 4e-4, 1e-4, 1e-4, 2e-4;
  noise_right << 3e-4, -1e-4, -1e-4, 5e-4;
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  double epipolar = 0.0, position = 0.0, known = 0.0, in_rig = 0.0;
  int count = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Eigen::Vector3d p_in_rig(400.0 + 250.0 * place(random), 300.0 * place(random), 1300.0 + 150.0 * place(random));
    const auto left_px = truth.left.project(p_in_rig);
    const auto right_px = truth.right.project(truth.right_from_left * p_in_rig);
    ASSERT_TRUE(left_px && right_px);
    base::ImageObservations left, right;
    left.observations = {observation(7, *left_px + Eigen::Vector2d(drawn(noise_left, random)), noise_left)};
    right.observations = {observation(7, *right_px + Eigen::Vector2d(drawn(noise_right, random)), noise_right)};
    const Eigen::VectorXd off = drawn(joint, random);
    base::Head head = moved(truth, off.head(n));
    head.cov = joint.topLeftCorner(n, n);
    const Eigen::Vector3d p_in_machine = true_pose * p_in_rig;
    MachineTie tie{.machine_from_rig = base::perturbed(true_pose, base::Vector6d(off.segment<6>(n))),
                   .cov = joint.block<6, 6>(n, n),
                   .known = {{7, p_in_machine + off.tail<3>(), joint.bottomRightCorner<3, 3>()}}};
    if (GetParam()) tie.joint_cov = joint;
    const auto seen = locate_markers(head, left, right, tie);
    ASSERT_TRUE(seen) << seen.error().message;
    ASSERT_EQ(seen->size(), 1u);
    const SpatialMarker& marker = seen->front();
    ASSERT_TRUE(marker.xyz_mm && marker.epipolar_w && marker.known_w);
    epipolar += *marker.epipolar_w * *marker.epipolar_w;
    position += tests::normalised_square(*marker.xyz_mm - p_in_machine, marker.cov_mm2());
    known += 3.0 * *marker.known_w * *marker.known_w;
    EXPECT_EQ(*marker.w(), std::max(std::abs(*marker.epipolar_w), *marker.known_w));
    const auto rig = locate_markers(head, left, right);
    in_rig += tests::normalised_square(*rig->front().xyz_mm - p_in_rig, rig->front().cov_mm2());
    EXPECT_FALSE(rig->front().known_w);
    ++count;
  }
  expect_chi_square(epipolar, count, 1, "epipolar misfit");
  expect_chi_square(position, count, 3, "point in machine");
  expect_chi_square(in_rig, count, 3, "point in rig");
  expect_chi_square(known, count, 3, "difference from the list");
}

INSTANTIATE_TEST_SUITE_P(Spatial, Sampled, ::testing::Bool(),
                         [](const auto& one) { return one.param ? "JointCovariance" : "IndependentParts"; });

TEST(Spatial, ACalibrationThatIsOffShows) {
  const base::Head truth = true_head();
  base::Head head = truth;
  head.right_from_left = base::perturbed(head.right_from_left, (base::Vector6d() << 8e-4, 0.0, 0.0, 0.0, 0.0, 0.0).finished());
  head.cov = head_sigmas(truth).cwiseAbs2().asDiagonal();
  const Eigen::Vector3d p_in_rig(400.0, 50.0, 1300.0);
  const Eigen::Matrix2d noise = 1e-4 * Eigen::Matrix2d::Identity();
  base::ImageObservations left, right;
  left.observations = {observation(1, *truth.left.project(p_in_rig), noise)};
  right.observations = {observation(1, *truth.right.project(truth.right_from_left * p_in_rig), noise)};
  EXPECT_GT(*locate_markers(head, left, right)->front().w(), 5.0);
}

TEST(Spatial, WhoSeesWhat) {
  const base::Head head = true_head();
  const Eigen::Vector3d p_in_rig(400.0, 0.0, 1300.0);
  const Eigen::Matrix2d noise = 1e-4 * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d left_px = *head.left.project(p_in_rig);
  const Eigen::Vector2d right_px = *head.right.project(head.right_from_left * p_in_rig);
  const auto with = [&](int id, const Eigen::Vector2d& px, base::ObservationStatus status) {
    base::Observation one = observation(id, px, noise);
    one.status = status;
    return one;
  };
  using enum base::ObservationStatus;
  base::ImageObservations left, right;
  left.observations = {with(1, left_px, kCoded), with(2, left_px, kCoded),   with(3, left_px, kAmbiguous),
                       with(4, left_px, kCoded), with(5, left_px, kRefused), with(base::kNoId, left_px, kUncoded),
                       with(9, left_px, kCoded)};
  right.observations = {with(1, right_px, kCoded), with(3, right_px, kCoded), with(4, right_px, kCoded),
                        with(4, right_px, kCoded), with(8, right_px, kAmbiguous)};
  right.observations.push_back({.id = 9, .centre_px = right_px, .status = kCoded});  // no covariance
  const auto seen = locate_markers(head, left, right);
  ASSERT_TRUE(seen);
  ASSERT_EQ(seen->size(), 6u);
  const auto expect = [&](std::size_t i, int id, bool in_left, bool in_right, bool doubtful, bool located) {
    EXPECT_EQ((*seen)[i].id, id);
    EXPECT_EQ((*seen)[i].left, in_left) << id;
    EXPECT_EQ((*seen)[i].right, in_right) << id;
    EXPECT_EQ((*seen)[i].doubtful, doubtful) << id;
    EXPECT_EQ((*seen)[i].xyz_mm.has_value(), located) << id;
  };
  expect(0, 1, true, true, false, true);
  expect(1, 2, true, false, false, false);
  expect(2, 3, true, true, true, true);
  expect(3, 4, true, true, true, false);
  expect(4, 8, false, true, true, false);
  expect(5, 9, true, true, false, false);
  EXPECT_LT((*(*seen)[0].xyz_mm - p_in_rig).norm(), 1e-6);
}

TEST(Spatial, ATieThatIsWrongIsRefused) {
  const base::Head head = true_head();
  MachineTie twice{.machine_from_rig = {}, .known = {{.id = 1}, {.id = 1}}};
  EXPECT_EQ(locate_markers(head, {}, {}, twice).error().code, base::ErrorCode::kUsage);
  MachineTie size{.machine_from_rig = {}, .known = {{.id = 1}}, .joint_cov = Eigen::MatrixXd::Identity(4, 4)};
  EXPECT_EQ(locate_markers(head, {}, {}, size).error().code, base::ErrorCode::kUsage);
}

/// Detector and geometry together: the twin's pictures of its cross, with the true head.
TEST(Spatial, TheTwinsCrossLiesWhereItIs) {
  fixtures::Scene scene = fixtures::drawn(*fixtures::make_scene("segment"), 1);
  double position = 0.0, epipolar = 0.0;
  int count = 0;
  for (const int station : {1, 3}) {
    std::array<std::size_t, 2> views = {};
    for (std::size_t v = 0; v < scene.views.size(); ++v) {
      const fixtures::View& view = scene.views[v];
      if (view.purpose != fixtures::Purpose::kStation || view.station != station) continue;
      const bool left = scene.cameras[static_cast<std::size_t>(view.camera)].name == scene.head->left;
      views[left ? 0 : 1] = v;
    }
    std::array<base::ImageObservations, 2> seen;
    for (const std::size_t side : {0U, 1U}) {
      const auto image = fixtures::render(scene, views[side], 5, 2);
      ASSERT_TRUE(image);
      seen[side] = *markers::detect(image->view(), scene.family);
    }
    const auto& left = scene.views[views[0]];
    const auto& right = scene.views[views[1]];
    const base::Head head{.left = *scene.cameras[static_cast<std::size_t>(left.camera)].camera,
                          .right = *scene.cameras[static_cast<std::size_t>(right.camera)].camera,
                          .right_from_left = right.scene_from_camera.inverse() * left.scene_from_camera};
    const auto markers = locate_markers(head, seen[0], seen[1]);
    ASSERT_TRUE(markers);
    const auto placed = fixtures::placed_markers(scene, views[0]);
    for (const SpatialMarker& marker : *markers) {
      if (!marker.xyz_mm || marker.doubtful) continue;
      const auto truth = std::find_if(placed.begin(), placed.end(), [&](const auto& one) { return one.id == marker.id; });
      ASSERT_NE(truth, placed.end()) << marker.id;
      const Eigen::Vector3d p_in_rig = left.scene_from_camera.inverse() * truth->scene_from_marker.translation_mm;
      position += tests::normalised_square(*marker.xyz_mm - p_in_rig, marker.cov_mm2());
      epipolar += *marker.epipolar_w * *marker.epipolar_w;
      ++count;
    }
  }
  ASSERT_GE(count, 30);
  expect_chi_square(position, count, 3, "markers of the twin");
  expect_chi_square(epipolar, count, 1, "their epipolar misfits");
}

}  // namespace
}  // namespace crosstie::live
