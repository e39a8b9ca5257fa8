#include "bundle/detail/distance.h"

namespace crosstie::bundle::detail {

bool Distance::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Eigen::Vector3d difference =
      Eigen::Map<const Eigen::Vector3d>(values[0]) - Eigen::Map<const Eigen::Vector3d>(values[1]);
  const double distance = difference.norm();
  if (!(distance > 0.0)) return false;
  *residual = (distance - length_mm_) / sigma_mm_;
  if (jacobians == nullptr) return true;
  const Eigen::Vector3d gradient = difference / (distance * sigma_mm_);
  if (jacobians[0] != nullptr) Eigen::Map<Eigen::Vector3d>(jacobians[0], 3) = gradient;
  if (jacobians[1] != nullptr) Eigen::Map<Eigen::Vector3d>(jacobians[1], 3) = -gradient;
  return true;
}

}  // namespace crosstie::bundle::detail
