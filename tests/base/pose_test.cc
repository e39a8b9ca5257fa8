#include "base/pose.h"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

namespace crosstie::base {
namespace {

constexpr double kPi = 3.14159265358979323846;

Eigen::Vector3d random_vector(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return {uniform(random), uniform(random), uniform(random)};
}

Pose random_pose(std::mt19937_64& random) { return {rotation_exp(random_vector(random, 1.7)), random_vector(random, 3000.0)}; }

/// exp of a skew matrix by its power series: Rodrigues' formula plays no part in it.
Eigen::Matrix3d matrix_exp(const Eigen::Vector3d& w) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d term = Eigen::Matrix3d::Identity();
  for (int i = 1; i < 60; ++i) {
    term = term * skew(w) / i;
    sum += term;
  }
  return sum;
}

TEST(Pose, TransformsAsItsMatrixDoes) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20; ++i) {
    const Pose machine_from_rig = random_pose(random);
    const Pose rig_from_camera = random_pose(random);
    const Eigen::Vector3d p_in_camera = random_vector(random, 1000.0);
    const Eigen::Vector4d expected = machine_from_rig.matrix() * rig_from_camera.matrix() * p_in_camera.homogeneous();
    EXPECT_LT(((machine_from_rig * rig_from_camera) * p_in_camera - expected.head<3>()).norm(), 1e-9);
    EXPECT_LT((machine_from_rig.inverse().matrix() - machine_from_rig.matrix().inverse()).norm(), 1e-9);
  }
}

TEST(Pose, ExponentialIsThePowerSeries) {
  std::mt19937_64 random(2);
  for (const double size : {0.0, 1e-12, 1e-6, 1.9e-4, 2.1e-4, 0.1, 1.0, 3.0}) {
    const Eigen::Vector3d w = random_vector(random, 1.0).normalized() * size;
    EXPECT_LT((rotation_exp(w).toRotationMatrix() - matrix_exp(w)).norm(), 1e-14) << size;
    EXPECT_LT((rotation_log(rotation_exp(w)) - w).norm(), 1e-14 * (1.0 + size)) << size;
  }
}

TEST(Pose, LogarithmIsTheShortWayRound) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 3).normalized();
  EXPECT_LT((rotation_log(rotation_exp(axis * (kPi + 0.1))) + axis * (kPi - 0.1)).norm(), 1e-14);
  EXPECT_NEAR(rotation_log(rotation_exp(axis * kPi)).norm(), kPi, 1e-14);
  Eigen::Quaterniond q = rotation_exp(axis * 0.3);
  q.coeffs() *= -1.0;  // the same rotation
  EXPECT_LT((rotation_log(q) - axis * 0.3).norm(), 1e-15);
}

TEST(Pose, DifferenceUndoesPerturbed) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 20; ++i) {
    const Pose from = random_pose(random);
    const Pose to = random_pose(random);
    const Pose again = perturbed(from, difference(from, to));
    EXPECT_LT((again.matrix() - to.matrix()).norm(), 1e-9);
  }
}

TEST(Pose, AdjointCarriesAPerturbationAcross) {
  // a_from_b * exp(d) = exp(Ad d) * a_from_b, to first order in d.
  std::mt19937_64 random(4);
  const Pose a_from_b = random_pose(random);
  const Pose b_from_c = random_pose(random);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 6; ++i) {
    Vector6d d = Vector6d::Zero();
    d[i] = kStep;
    const Vector6d moved = difference(a_from_b * b_from_c, a_from_b * perturbed(b_from_c, d)) / kStep;
    EXPECT_LT((moved - a_from_b.adjoint().col(i)).norm(), 2e-3) << i;  // second order: 1e-6 of 3000 mm
  }
}

TEST(Pose, PositionCovarianceIsThatOfSampledPoses) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const Pose pose = random_pose(random);
  Matrix6d factor;
  for (int i = 0; i < 36; ++i) factor(i / 6, i % 6) = normal(random);
  factor.topRows<3>() *= 1e-5;
  factor.bottomRows<3>() *= 0.02;
  constexpr int kSamples = 40000;
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  for (int s = 0; s < kSamples; ++s) {
    Vector6d unit;
    for (int i = 0; i < 6; ++i) unit[i] = normal(random);
    const Eigen::Vector3d shift = perturbed(pose, factor * unit).translation_mm - pose.translation_mm;
    sampled += shift * shift.transpose() / kSamples;
  }
  const Eigen::Matrix3d predicted = position_covariance(pose, factor * factor.transpose());
  EXPECT_LT((sampled - predicted).norm(), 0.03 * predicted.norm());
}

TEST(Pose, IsReadFromARigidMatrixOnly) {
  std::mt19937_64 random(6);
  const Pose pose = random_pose(random);
  const auto same = pose_from_matrix(pose.matrix());
  ASSERT_TRUE(same);
  EXPECT_LT((same->matrix() - pose.matrix()).norm(), 1e-12);

  Eigen::Matrix4d m = pose.matrix();
  m.topLeftCorner<3, 3>() *= 1.0 + 2e-6;
  EXPECT_FALSE(pose_from_matrix(m));
  m = pose.matrix();
  m.col(2).head<3>() *= -1.0;
  EXPECT_FALSE(pose_from_matrix(m)) << "a reflection";
  EXPECT_FALSE(pose_from_matrix(pose.matrix().transpose())) << "column by column";
  m = pose.matrix();
  m(0, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(pose_from_matrix(m));
  EXPECT_FALSE(pose_from_matrix(Eigen::Matrix4d::Zero()));
}

}  // namespace
}  // namespace crosstie::base
