// Where the head and the cross are in machine: values and joint covariance against draws of the commissioning's parameters.
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "app/live/machine_tie.h"
#include "base/commissioning_layout.h"
#include "base/pose.h"
#include "tests/support/synthetic_commissioning.h"

namespace crosstie::app {
namespace {

using base::Commissioning;
using base::ErrorCode;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr Index kHead = 24;
constexpr Index kFrame = 12;
constexpr Index kMarkers = 12;

VectorXd normals(Index size, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  VectorXd values(size);
  for (Index i = 0; i < size; ++i) values(i) = normal(random);
  return values;
}

/// A commissioning with error motions, in which everything is correlated with everything else.
Commissioning correlated_commissioning() {
  Commissioning result = tests::synthetic_commissioning(3);
  result.machine_from_cross = {base::rotation_exp({0.3, -0.2, 0.5}), {350.0, 20.0, 5.0}};
  result.frame.axis.stop_sigma_mm = 0.004;
  result.frame.axis.stop_sigma_rad = 3e-6;
  result.frame.axis.pivot_mm = {100.0, -50.0, 1200.0};
  // Two unit vectors across the direction.
  const Vector3d direction = result.frame.axis.direction_in_machine;
  result.frame.across.col(0) = direction.cross(Vector3d::UnitZ()).normalized();
  result.frame.across.col(1) = direction.cross(result.frame.across.col(0));
  const Index size = kHead + kFrame + 7 + 3 * kMarkers;
  VectorXd sigmas(size);
  sigmas.head(kHead) = result.head.cov.diagonal().cwiseSqrt();
  sigmas.segment(kHead, kFrame) = result.frame.cov.diagonal().cwiseSqrt();
  sigmas.segment<6>(kHead + kFrame) = result.machine_from_cross_cov.diagonal().cwiseSqrt();
  sigmas(kHead + kFrame + 6) = result.growth_sigma_ppm;
  sigmas.tail(3 * kMarkers).setConstant(0.01);
  std::mt19937_64 random(7);
  MatrixXd mixed(size, size);
  for (Index i = 0; i < size; ++i) mixed.col(i) = normals(size, random);
  MatrixXd correlation = mixed * mixed.transpose() / static_cast<double>(size) + 0.3 * MatrixXd::Identity(size, size);
  const VectorXd scale = correlation.diagonal().cwiseSqrt().cwiseInverse();
  result.covariance = (sigmas.cwiseProduct(scale)).asDiagonal() * correlation * (sigmas.cwiseProduct(scale)).asDiagonal();
  result.frame.cov = result.covariance.block(kHead, kHead, kFrame, kFrame);
  return result;
}

/// The commissioning as it would be with other parameters: the model of base/machine.h, not its derivatives.
Commissioning moved(const Commissioning& from, const VectorXd& by) {
  Commissioning to = from;
  base::LinearAxis& axis = to.frame.axis;
  const auto frame = by.segment(kHead, kFrame);
  to.frame.machine_from_rig_at_middle = base::perturbed(from.frame.machine_from_rig_at_middle, frame.head<6>());
  axis.direction_in_machine = (axis.direction_in_machine + from.frame.across * frame.segment<2>(6)).normalized();
  axis.scale_ppm += frame(8);
  Index column = 9;
  for (base::ErrorMotion& term : axis.terms) {
    if (term.in_frame) term.value += frame(column++);
  }
  to.machine_from_cross = base::perturbed(from.machine_from_cross, by.segment<6>(kHead + kFrame));
  for (std::size_t i = 0; i < to.markers.size(); ++i)
    to.markers[i].xyz_mm += by.segment<3>(kHead + kFrame + 7 + 3 * static_cast<Index>(i));
  return to;
}

TEST(MachineTie, SaysWhereTheHeadAndTheCrossAre) {
  const Commissioning commissioning = correlated_commissioning();
  const auto tie = machine_tie(commissioning, 250.0);
  ASSERT_TRUE(tie) << tie.error().message;
  const auto pose = commissioning.frame.at(250.0);
  EXPECT_LT(base::difference(pose->machine_from_rig, tie->machine_from_rig).norm(), 1e-12);
  EXPECT_TRUE(tie->cov.isApprox(pose->cov + pose->stop_cov));
  ASSERT_EQ(tie->known.size(), commissioning.markers.size());
  EXPECT_EQ(tie->known[4].id, commissioning.markers[4].id);
  EXPECT_LT((tie->known[4].xyz_mm - commissioning.machine_from_cross * commissioning.markers[4].xyz_mm).norm(), 1e-9);
  EXPECT_TRUE((tie->joint_cov.block<6, 6>(kHead, kHead)).isApprox(tie->cov)) << "one covariance of the pose, told twice";
}

TEST(MachineTie, ItsJointCovarianceIsThatOfDrawnCommissionings) {
  const Commissioning commissioning = correlated_commissioning();
  const MatrixXd factor = commissioning.covariance.llt().matrixL();
  std::mt19937_64 random(11);
  for (const double axis_mm : {-100.0, 620.0}) {
    const auto tie = machine_tie(commissioning, axis_mm);
    ASSERT_TRUE(tie) << tie.error().message;
    const Index size = kHead + 6 + 3 * kMarkers;
    ASSERT_EQ(tie->joint_cov.rows(), size);
    const Eigen::LLT<MatrixXd> whitening(tie->joint_cov);
    ASSERT_EQ(whitening.info(), Eigen::Success);
    const base::Matrix6d stop_factor = commissioning.frame.at(axis_mm)->stop_cov.llt().matrixL();
    constexpr int kDraws = 2000;
    MatrixXd whitened(size, kDraws);
    MatrixXd scaled(size, kDraws);
    const VectorXd sigmas = tie->joint_cov.diagonal().cwiseSqrt();
    for (int draw = 0; draw < kDraws; ++draw) {
      const VectorXd by = factor * normals(factor.rows(), random);
      const Commissioning other = moved(commissioning, by);
      const base::Pose stop = base::perturbed(other.frame.at(axis_mm)->machine_from_rig, stop_factor * normals(6, random));
      VectorXd off(size);
      off.head(kHead) = by.head(kHead);
      off.segment<6>(kHead) = base::difference(tie->machine_from_rig, stop);
      for (Index i = 0; i < kMarkers; ++i) {
        const auto index = static_cast<std::size_t>(i);
        off.segment<3>(kHead + 6 + 3 * i) = other.machine_from_cross * other.markers[index].xyz_mm - tie->known[index].xyz_mm;
      }
      whitened.col(draw) = whitening.matrixL().solve(off);
      scaled.col(draw) = off.cwiseQuotient(sigmas);
    }
    // Each sum of squares is chi-square; 4.5 of its sigmas are never passed by chance.
    const double of_one = 4.5 * std::sqrt(2.0 / kDraws);
    EXPECT_NEAR(whitened.squaredNorm() / static_cast<double>(size * kDraws), 1.0,
                of_one / std::sqrt(static_cast<double>(size)));
    for (Index i = 0; i < size; ++i) {
      EXPECT_NEAR(whitened.row(i).squaredNorm() / kDraws, 1.0, of_one) << "direction " << i << " at " << axis_mm;
      EXPECT_NEAR(scaled.row(i).squaredNorm() / kDraws, 1.0, of_one) << "parameter " << i << " at " << axis_mm;
    }
    // The correlations: of independent whitened values none is left. Its sigma is 1 / sqrt(N).
    const MatrixXd products = whitened * whitened.transpose() / kDraws;
    for (Index i = 0; i < size; ++i) {
      for (Index j = 0; j < i; ++j) EXPECT_NEAR(products(i, j), 0.0, 5.0 / std::sqrt(kDraws)) << i << " and " << j;
    }
  }
}

TEST(MachineTie, NothingIsKnownOutsideOfTheTravelOrByAnotherCovariance) {
  Commissioning commissioning = correlated_commissioning();
  const auto outside = machine_tie(commissioning, 1200.0);
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, ErrorCode::kBadInput);
  commissioning.markers.pop_back();
  const auto other = machine_tie(commissioning, 250.0);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kBadInput);
}

}  // namespace
}  // namespace crosstie::app
