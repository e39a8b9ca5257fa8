#include "math/prior.h"

namespace crosstie::math {

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
