#pragma once

#include <string>

#include <Eigen/Core>

#include "base/result.h"
#include "math/model.h"

namespace crosstie::math {

/// The root of the inverse of a covariance; directions without variance (a datum) get a hundredth of the least sigma. kBadInput,
/// beginning with `name`, where the covariance is not positive semi-definite.
base::Result<Eigen::MatrixXd> whitening_of(const Eigen::MatrixXd& cov, const std::string& name);

/// The same of a covariance with mixed units: the root of the inverse of its correlation, over the sigmas. Columns without variance are
/// zero, and there are no rows for them.
base::Result<Eigen::MatrixXd> whitening_of_mixed(const Eigen::MatrixXd& cov, const std::string& name);

/// Values of vector blocks known beforehand: residual = whitening * (x - mean), x the blocks' values one after the other,
/// whitening' whitening the pseudo-inverse of their covariance.
class Prior final : public Measurement {
 public:
  /// `sizes` are those of the blocks; their sum is that of `mean` and of the columns of `whitening`.
  Prior(std::vector<int> blocks, std::vector<int> sizes, Eigen::VectorXd mean, Eigen::MatrixXd whitening)
      : Measurement(std::move(blocks)), sizes_(std::move(sizes)), mean_(std::move(mean)), whitening_(std::move(whitening)) {}

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  std::vector<int> sizes_;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd whitening_;
};

}  // namespace crosstie::math
