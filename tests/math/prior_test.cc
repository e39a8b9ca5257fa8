// The root of a covariance's inverse, where the covariance has a datum: against what the variances say.

#include "math/prior.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace crosstie::math {
namespace {

/// A covariance of the given variances in directions of its own.
Eigen::MatrixXd turned(const Eigen::VectorXd& variances) {
  Eigen::MatrixXd mixing(variances.size(), variances.size());
  for (Eigen::Index i = 0; i < mixing.size(); ++i) mixing(i) = std::sin(3.0 + 7.0 * static_cast<double>(i));
  const Eigen::MatrixXd axes = Eigen::HouseholderQR<Eigen::MatrixXd>(mixing).householderQ();
  return axes * variances.asDiagonal() * axes.transpose();
}

/// Variances that a root stands for, ascending.
Eigen::VectorXd variances_of(const Eigen::MatrixXd& root) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(root.transpose() * root).eigenvalues().reverse().cwiseInverse();
}

TEST(Whitening, TakesWhatRoundingLeftOfADatumForNoVariance) {
  // As inverse normal matrices of free networks leave them: six directions that are zero but for rounding, of either sign.
  Eigen::VectorXd variances(10);
  variances << -6e-17, 4e-18, 2e-17, 1.3e-16, 2.6e-16, 1.9e-15, 3e-6, 4e-6, 1e-5, 2.4e-4;
  const auto root = whitening_of(turned(variances), "cross");
  ASSERT_TRUE(root) << root.error().message;
  const Eigen::VectorXd held = variances_of(*root);
  for (Eigen::Index i = 0; i < 6; ++i) EXPECT_NEAR(held(i), 3e-10, 3e-12) << "a hundredth of the least sigma, squared";
  for (Eigen::Index i = 6; i < 10; ++i) EXPECT_NEAR(held(i), variances(i), 1e-6 * variances(i));
}

TEST(Whitening, KeepsASmallVarianceThatIsNone) {
  Eigen::VectorXd variances(3);
  variances << 5e-9, 0.2, 1.0;
  const auto root = whitening_of(turned(variances), "lens");
  ASSERT_TRUE(root) << root.error().message;
  EXPECT_NEAR(variances_of(*root)(0), 5e-9, 1e-14);
}

TEST(Whitening, RefusesAVarianceBelowNone) {
  Eigen::VectorXd variances(3);
  variances << -1e-3, 0.2, 1.0;
  EXPECT_FALSE(whitening_of(turned(variances), "lens"));
}

}  // namespace
}  // namespace crosstie::math
