#pragma once

#include <Eigen/Core>

namespace crosstie::bundle::detail {

/// The unknowns of y = design * x + noise of covariance `cov`, by least squares.
struct LinearEstimate {
  Eigen::VectorXd x;
  Eigen::MatrixXd cov;
  Eigen::VectorXd residual;  ///< left after the fit
  Eigen::MatrixXd residual_cov;
};

/// Columns may have different units; the design must have full rank.
LinearEstimate linear_estimate(const Eigen::MatrixXd& design, const Eigen::VectorXd& y, const Eigen::MatrixXd& cov);

/// x' Cov^-1 x, solved by the correlations: rad and mm stand side by side.
double statistic(const Eigen::VectorXd& x, const Eigen::MatrixXd& cov);

}  // namespace crosstie::bundle::detail
