// Planned sigmas: of a point by drawing lenses, rig and frame from their joint covariance; what a plan says of error motions against what a
// commissioning finds.
#include "bundle/plan.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "math/distributions.h"
#include "tests/bundle/synthetic_head.h"

namespace crosstie::bundle {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A head, its rig and its frame, moved by a vector of the joint covariance's order.
struct Moved {
  base::Head head;
  base::MachineFrame frame;
};

Moved moved(const base::Commissioning& result, const VectorXd& by) {
  Moved one{result.head, result.frame};
  const Index l = one.head.left.parameters().size();
  const Index r = one.head.right.parameters().size();
  const auto lens = [](const base::Camera& camera, const VectorXd& change) {
    return *base::Camera::make(camera.model(), camera.width_px(), camera.height_px(), camera.parameters() + change);
  };
  one.head.left = lens(one.head.left, by.head(l));
  one.head.right = lens(one.head.right, by.segment(l, r));
  one.head.right_from_left = base::perturbed(one.head.right_from_left, by.segment<6>(l + r));
  const Index f = l + r + 6;
  base::LinearAxis& axis = one.frame.axis;
  one.frame.machine_from_rig_at_middle = base::perturbed(one.frame.machine_from_rig_at_middle, by.segment<6>(f));
  axis.direction_in_machine = (axis.direction_in_machine + one.frame.across * by.segment<2>(f + 6)).normalized();
  axis.scale_ppm += by(f + 8);
  Index place = f + 9;
  for (base::ErrorMotion& term : axis.terms) {
    if (term.in_frame) term.value += by(place++);
  }
  return one;
}

Eigen::Vector3d triangulated(const base::Head& head, const Eigen::Vector2d& left, const Eigen::Vector2d& right,
                             Eigen::Vector3d p) {
  for (int i = 0; i < 8; ++i) {
    Eigen::Matrix<double, 2, 3> d_left;
    Eigen::Matrix<double, 2, 3> d_right;
    const auto q_left = head.left.project(p, &d_left);
    const auto q_right = head.right.project(head.right_from_left * p, &d_right);
    if (!q_left || !q_right) return Eigen::Vector3d::Constant(std::nan(""));
    Eigen::Matrix<double, 4, 3> jacobian;
    jacobian << d_left, d_right * head.right_from_left.rotation.toRotationMatrix();
    Eigen::Vector4d residual;
    residual << *q_left - left, *q_right - right;
    p -= (jacobian.transpose() * jacobian).ldlt().solve(jacobian.transpose() * residual);
  }
  return p;
}

TEST(Plan, TheSigmaOfAPointIsTrueByDrawing) {
  constexpr int kDraws = 2000;
  constexpr double kSigma_px = 0.05;
  const tests::SyntheticHead head = tests::make_head({}, 3);
  const auto result = commission(head.input);
  ASSERT_TRUE(result) << result.error().message;
  const Eigen::Vector3d p_in_machine = result->machine_from_cross * Eigen::Vector3d(120.0, -80.0, 40.0);
  const base::PlannedPoint point = plan_point(*result, p_in_machine, kSigma_px);
  ASSERT_TRUE(point.cov_mm2);
  EXPECT_GE(point.axis_mm, result->frame.axis.from_mm);
  EXPECT_LE(point.axis_mm, result->frame.axis.to_mm);
  const auto pose = result->frame.at(point.axis_mm);
  ASSERT_TRUE(pose);
  const Eigen::Vector3d p_in_rig = pose->machine_from_rig.inverse() * p_in_machine;
  const Eigen::Vector2d left = *result->head.left.project(p_in_rig);
  const Eigen::Vector2d right = *result->head.right.project(result->head.right_from_left * p_in_rig);

  const Index size = result->head.parameter_count() + result->frame.cov.rows();
  const Eigen::MatrixXd cov = result->covariance.topLeftCorner(size, size);
  const VectorXd sigma = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const VectorXd scale = sigma.cwiseMax(1e-300).cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * cov * scale.asDiagonal());
  const Eigen::MatrixXd root =
      sigma.asDiagonal() * eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  double measured = 0.0;
  double frame_alone = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    VectorXd z(size);
    for (Index k = 0; k < size; ++k) z(k) = normal(random);
    const Moved one = moved(*result, root * z);
    const base::Pose machine_from_rig = one.frame.at(point.axis_mm)->machine_from_rig;
    const Eigen::Vector2d noise_left(kSigma_px * normal(random), kSigma_px * normal(random));
    const Eigen::Vector2d noise_right(kSigma_px * normal(random), kSigma_px * normal(random));
    const Eigen::Vector3d seen =
        machine_from_rig * triangulated(one.head, left + noise_left, right + noise_right, p_in_rig) - p_in_machine;
    measured += seen.dot(point.cov_mm2->ldlt().solve(seen));
    const Eigen::Vector3d by_frame = machine_from_rig * p_in_rig - p_in_machine;
    frame_alone += by_frame.dot(point.frame_cov_mm2.ldlt().solve(by_frame));
  }
  for (const double square : {measured, frame_alone}) {
    EXPECT_GT(square, math::chi_square_quantile(0.0005, 3.0 * kDraws));
    EXPECT_LT(square, math::chi_square_quantile(0.9995, 3.0 * kDraws));
  }
  // Behind the head nothing is measured, and the frame alone answers.
  EXPECT_FALSE(plan_point(*result, p_in_machine + Eigen::Vector3d(0.0, 0.0, 5000.0), kSigma_px).cov_mm2);
}

TEST(Plan, SaysWhichErrorMotionsAreFound) {
  tests::HeadPlan quiet;
  const auto plan = plan_commission(tests::make_head(quiet, 5).input);
  ASSERT_TRUE(plan) << plan.error().message;
  const auto smallest = [&](const char* name, int order) {
    for (const base::PlannedMotion& motion : plan->motions) {
      if (motion.name == name && motion.order == order) return motion.smallest;
    }
    return 0.0;
  };
  // (3.29 + 1.645) sigma; the tests of commission find an EBX of +-50 urad in about nine of ten cases (commission_test.cc).
  EXPECT_NEAR(smallest("EBX", 1), 52e-6, 12e-6);
  EXPECT_GT(smallest("EZX", 2), 0.0);
  // With power one half it is what the test's limit is: 3.29 sigma.
  const auto half = plan_commission(tests::make_head(quiet, 5).input, {.power = 0.5001});
  ASSERT_TRUE(half);
  for (std::size_t i = 0; i < plan->motions.size(); ++i) {
    EXPECT_NEAR(plan->motions[i].smallest / plan->motions[i].sigma, 3.2905 + 1.6449, 1e-3);
    EXPECT_NEAR(half->motions[i].smallest / half->motions[i].sigma, 3.2905, 1e-3);
  }
  EXPECT_FALSE(plan_commission(tests::make_head(quiet, 5).input, {.power = 1.0}));
}

}  // namespace
}  // namespace crosstie::bundle
