#pragma once

#include "math/model.h"

namespace crosstie::bundle::detail {

/// A known distance between two points: residual = (|X_a - X_b| - length) / sigma.
class Distance final : public math::Measurement {
 public:
  Distance(int point_block_a, int point_block_b, double length_mm, double sigma_mm)
      : math::Measurement({point_block_a, point_block_b}), length_mm_(length_mm), sigma_mm_(sigma_mm) {}

  [[nodiscard]] int rows() const override { return 1; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  double length_mm_;
  double sigma_mm_;
};

}  // namespace crosstie::bundle::detail
