#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "base/pose.h"

namespace crosstie::tests {

/// e' C^-1 e, whose expectation is the number of values where C is true. Solved by the correlations: rad and mm stand side by side in C.
inline double normalised_square(const Eigen::VectorXd& error, const Eigen::MatrixXd& cov) {
  const Eigen::VectorXd scale = cov.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * cov * scale.asDiagonal();
  const Eigen::VectorXd scaled = scale.cwiseProduct(error);
  return scaled.dot(correlation.ldlt().solve(scaled));
}

/// Of a pose and its covariance [rad, mm].
inline double normalised_square(const base::Pose& measured, const base::Pose& truth, const base::Matrix6d& cov) {
  return normalised_square(base::difference(truth, measured), cov);
}

}  // namespace crosstie::tests
