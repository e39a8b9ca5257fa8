#include "bundle/detail/prior.h"

namespace crosstie::bundle::detail {

bool Prior::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Eigen::Map<const Eigen::VectorXd> x(values[0], mean_.size());
  Eigen::Map<Eigen::VectorXd>(residual, whitening_.rows()) = whitening_ * (x - mean_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<math::WhitenedRows::Matrix>(jacobians[0], whitening_.rows(), whitening_.cols()) = whitening_;
  }
  return true;
}

}  // namespace crosstie::bundle::detail
