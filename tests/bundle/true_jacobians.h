#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "math/model.h"

namespace crosstie::tests {

/// Every Jacobian of a measurement against central differences of its residual along each tangent direction.
inline void expect_true_jacobians(math::Model& model) {
  const math::Measurement& measurement = *model.measurements.front();
  math::WhitenedRows rows;
  ASSERT_TRUE(model.linearise(rows));
  const math::Parameters parameters = model.parameters();
  const auto residual_after = [&](const Eigen::VectorXd& step) {
    std::vector<math::Block> blocks = model.blocks;
    model.move(step);
    math::WhitenedRows moved;
    EXPECT_TRUE(model.linearise(moved));
    model.blocks = std::move(blocks);
    return Eigen::VectorXd(moved.residual(0));
  };
  for (std::size_t t = 0; t < rows.terms(0).size(); ++t) {
    const math::ParameterBlock& block = parameters.block(rows.terms(0)[t].block);
    const Eigen::MatrixXd jacobian = rows.jacobian(0, t);
    for (int i = 0; i < block.size(); ++i) {
      const double typical = std::max(jacobian.col(i).norm(), 1e-3);
      const double h = 1e-4 / typical;
      Eigen::VectorXd step = Eigen::VectorXd::Zero(parameters.size());
      step(block.offset + i) = h;
      const Eigen::VectorXd numeric = (residual_after(step) - residual_after(-step)) / (2.0 * h);
      EXPECT_LT((numeric - jacobian.col(i)).norm(), 2e-6 * typical) << parameters.label(block.offset + i);
    }
  }
  EXPECT_EQ(rows.row_count(), measurement.rows());
}

}  // namespace crosstie::tests
