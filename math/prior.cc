#include "math/prior.h"

#include <algorithm>
#include <vector>

#include <Eigen/Eigenvalues>

namespace crosstie::math {

base::Result<Eigen::MatrixXd> whitening_of(const Eigen::MatrixXd& cov, const std::string& name) {
  constexpr double kRounding =
      1e-10;  // over the largest eigenvalue: below, a direction without variance may have been rounded to it
  constexpr double kExact = 1e-4;  // over the least variance beyond that; less loses digits where a growth moves what is exact
  if (cov.size() == 0) return Eigen::MatrixXd(0, 0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(cov);
  Eigen::VectorXd values = eigen.eigenvalues();
  const double largest = values.maxCoeff();
  if (!(largest > 0.0) || values.minCoeff() < -1e-9 * largest) {
    return base::fail(base::ErrorCode::kBadInput, name + ": the covariance is not positive semi-definite");
  }
  const double least = *std::find_if(values.begin(), values.end(), [&](double v) { return v > kRounding * largest; });
  values = values.cwiseMax(kExact * least);
  return Eigen::MatrixXd(values.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose());
}

base::Result<Eigen::MatrixXd> whitening_of_mixed(const Eigen::MatrixXd& cov, const std::string& name) {
  std::vector<Eigen::Index> known;
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    if (cov(i, i) > 0.0) known.push_back(i);
  }
  const Eigen::VectorXd scale = cov.diagonal()(known).cwiseSqrt().cwiseInverse();
  auto root = whitening_of(scale.asDiagonal() * cov(known, known) * scale.asDiagonal(), name);
  if (!root) return base::fail(std::move(root));
  Eigen::MatrixXd whitening = Eigen::MatrixXd::Zero(root->rows(), cov.rows());
  whitening(Eigen::all, known) = *root * scale.asDiagonal();
  return whitening;
}

bool Prior::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  Eigen::VectorXd difference = -mean_;
  Eigen::Index offset = 0;
  for (std::size_t i = 0; i < sizes_.size(); ++i) {
    difference.segment(offset, sizes_[i]) += Eigen::Map<const Eigen::VectorXd>(values[i], sizes_[i]);
    if (jacobians != nullptr && jacobians[i] != nullptr) {
      Eigen::Map<WhitenedRows::Matrix>(jacobians[i], whitening_.rows(), sizes_[i]) = whitening_.middleCols(offset, sizes_[i]);
    }
    offset += sizes_[i];
  }
  Eigen::Map<Eigen::VectorXd>(residual, whitening_.rows()) = whitening_ * difference;
  return true;
}

}  // namespace crosstie::math
