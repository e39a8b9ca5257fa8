#include "bundle/detail/linear_estimate.h"

#include <Eigen/Cholesky>

namespace crosstie::bundle::detail {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearEstimate linear_estimate(const MatrixXd& design, const VectorXd& y, const MatrixXd& cov) {
  const Eigen::LLT<MatrixXd> root(cov);
  const MatrixXd a = root.matrixL().solve(design);
  const VectorXd b = root.matrixL().solve(y);
  const VectorXd scale = a.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const MatrixXd scaled = a * scale.asDiagonal();
  const Eigen::LDLT<MatrixXd> normal(scaled.transpose() * scaled);
  LinearEstimate at;
  at.x = scale.asDiagonal() * normal.solve(scaled.transpose() * b);
  at.cov = scale.asDiagonal() * normal.solve(MatrixXd::Identity(scaled.cols(), scaled.cols())) * scale.asDiagonal();
  at.residual = y - design * at.x;
  at.residual_cov = cov - design * at.cov * design.transpose();
  return at;
}

double statistic(const VectorXd& x, const MatrixXd& cov) {
  const VectorXd scale = cov.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd correlation = scale.asDiagonal() * cov * scale.asDiagonal();
  const VectorXd scaled = scale.cwiseProduct(x);
  return scaled.dot(correlation.ldlt().solve(scaled));
}

}  // namespace crosstie::bundle::detail
