#pragma once

#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

namespace crosstie::tests {

/// e' Q^+ e without what the datum holds: coordinates without variance, and the `defect` least eigenvalues.
inline double normalised_square(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, int defect) {
  std::vector<Eigen::Index> varying;
  for (Eigen::Index i = 0; i < error.size(); ++i) {
    if (covariance(i, i) > 1e-15) {
      varying.push_back(i);
    } else {
      EXPECT_LT(std::abs(error(i)), 1e-9) << i;
    }
  }
  const Eigen::MatrixXd q = covariance(varying, varying);
  const Eigen::VectorXd sigma = q.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation = sigma.cwiseInverse().asDiagonal() * q * sigma.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);
  const int left = defect - static_cast<int>(error.size() - q.rows());
  if (left > 0) {
    EXPECT_LT(std::abs(eigen.eigenvalues()(left - 1)), 1e-10);
  }
  EXPECT_GT(eigen.eigenvalues()(left), 1e-10);
  const Eigen::VectorXd scaled = error(varying).cwiseQuotient(sigma);
  double sum = 0.0;
  for (Eigen::Index i = left; i < scaled.size(); ++i) {
    sum += std::pow(eigen.eigenvectors().col(i).dot(scaled), 2) / eigen.eigenvalues()(i);
  }
  return sum;
}

}  // namespace crosstie::tests
