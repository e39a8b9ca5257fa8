// Roots of covariances whose parameters have units of very different size.

#include "math/covariance_root.h"

#include <gtest/gtest.h>

namespace crosstie::math {
namespace {

TEST(CovarianceRoot, GivesTheCovarianceBackWhateverTheUnits) {
  // A pose: radians beside millimetres, correlated.
  Eigen::Matrix3d correlation;
  correlation << 1.0, 0.8, -0.3, 0.8, 1.0, 0.1, -0.3, 0.1, 1.0;
  const Eigen::Vector3d sigma(2e-7, 0.03, 40.0);
  const Eigen::MatrixXd cov = sigma.asDiagonal() * correlation * sigma.asDiagonal();
  const CovarianceRoot found = covariance_root(cov);
  ASSERT_EQ(found.root.cols(), 3);
  const Eigen::MatrixXd again = found.root * found.root.transpose();
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) EXPECT_NEAR(again(i, j), cov(i, j), 1e-12 * sigma(i) * sigma(j));
  }
  const Eigen::MatrixXd one = sigma.cwiseInverse().asDiagonal() * (cov * found.inverse) * sigma.asDiagonal();
  EXPECT_LT((one - Eigen::Matrix3d::Identity()).norm(), 1e-9);
}

TEST(CovarianceRoot, ExactDirectionsHaveNoCause) {
  // Two lengths whose sum is exact, and a parameter that is held.
  Eigen::Matrix3d cov;
  cov << 4.0, -4.0, 0.0, -4.0, 4.0, 0.0, 0.0, 0.0, 0.0;
  const CovarianceRoot found = covariance_root(cov);
  ASSERT_EQ(found.root.cols(), 1);
  EXPECT_LT((found.root * found.root.transpose() - cov).norm(), 1e-12);
  EXPECT_LT((cov * found.inverse * cov - cov).norm(), 1e-12);
  EXPECT_EQ(covariance_root(Eigen::MatrixXd()).root.size(), 0);
  EXPECT_EQ(covariance_root(Eigen::Matrix2d::Zero()).root.cols(), 0);
}

}  // namespace
}  // namespace crosstie::math
