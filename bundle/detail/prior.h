#pragma once

#include <Eigen/Core>

#include "bundle/detail/model.h"

namespace crosstie::bundle::detail {

/// Values of a vector block known beforehand: residual = whitening * (x - mean), whitening' whitening = covariance^-1.
class Prior final : public Measurement {
 public:
  Prior(int block, Eigen::VectorXd mean, Eigen::MatrixXd whitening)
      : Measurement({block}), mean_(std::move(mean)), whitening_(std::move(whitening)) {}

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::VectorXd mean_;
  Eigen::MatrixXd whitening_;
};

}  // namespace crosstie::bundle::detail
