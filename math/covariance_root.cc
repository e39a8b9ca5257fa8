#include "math/covariance_root.h"

#include <algorithm>

#include <Eigen/Eigenvalues>

namespace crosstie::math {

CovarianceRoot covariance_root(const Eigen::MatrixXd& cov) {
  constexpr double kSingular = 1e-12;  // of the largest eigenvalue
  if (cov.size() == 0) return {Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 0)};
  const Eigen::VectorXd sigma = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd scale = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * cov * scale.asDiagonal());
  const double limit = kSingular * std::max(1e-300, eigen.eigenvalues().maxCoeff());
  const auto kept = static_cast<Eigen::Index>((eigen.eigenvalues().array() > limit).count());
  const Eigen::MatrixXd vectors = eigen.eigenvectors().rightCols(kept);
  const Eigen::VectorXd values = eigen.eigenvalues().tail(kept);
  CovarianceRoot result;
  result.root = sigma.asDiagonal() * vectors * values.cwiseSqrt().asDiagonal();
  result.inverse = scale.asDiagonal() * vectors * values.cwiseInverse().asDiagonal() * vectors.transpose() * scale.asDiagonal();
  return result;
}

}  // namespace crosstie::math
