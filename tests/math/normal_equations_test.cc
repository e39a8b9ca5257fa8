#include "math/normal_equations.h"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "math/cofactors.h"

namespace crosstie::math {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A levelling net as a small stand-in for a bundle: `instruments` (kept) see `marks` (eliminated), observation = height of the
/// mark minus height of the instrument; a level difference between marks 1 and 2 joins them in one cell. All heights may be
/// shifted together: one free direction. `dense` holds the same Jacobian for a solution by other means.
struct LevellingNet {
  Parameters parameters;
  WhitenedRows rows;
  MatrixXd dense;
  VectorXd residual;
  MatrixXd shift;

  explicit LevellingNet(bool tilt = true) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> value(-1.0, 1.0);
    const int instruments = 3;
    const int marks = 5;
    std::vector<int> block;
    for (int m = 0; m < 2; ++m)
      block.push_back(parameters.add("mark " + std::to_string(m), {"h [mm]"}, BlockRole::kEliminated));
    for (int i = 0; i < instruments; ++i) {
      std::vector<std::string> components{"h [mm]"};
      if (tilt) components.push_back("tilt [rad]");
      block.push_back(parameters.add("instrument " + std::to_string(i), components, BlockRole::kKept));
    }
    for (int m = 2; m < marks; ++m)
      block.push_back(parameters.add("mark " + std::to_string(m), {"h [mm]"}, BlockRole::kEliminated));
    const auto mark = [&](int m) { return block[static_cast<std::size_t>(m < 2 ? m : m + instruments)]; };
    const auto instrument = [&](int i) { return block[static_cast<std::size_t>(2 + i)]; };
    std::vector<VectorXd> lines;
    std::vector<double> residuals;
    for (int i = 0; i < instruments; ++i) {
      for (int m = 0; m < marks; ++m) {
        const int blocks[] = {instrument(i), mark(m)};
        const int sizes[] = {parameters.block(blocks[0]).size(), 1};
        const int g = rows.add(1, blocks, sizes);
        const double weight = 1.0 + 0.3 * i;
        rows.residual(g)(0) = value(random);
        rows.jacobian(g, 0)(0, 0) = -weight;
        if (tilt) rows.jacobian(g, 0)(0, 1) = value(random);
        rows.jacobian(g, 1)(0, 0) = weight;
        VectorXd line = VectorXd::Zero(parameters.size());
        line.segment(parameters.block(blocks[0]).offset, sizes[0]) = rows.jacobian(g, 0).row(0);
        line(parameters.block(blocks[1]).offset) = weight;
        lines.push_back(line);
        residuals.push_back(rows.residual(g)(0));
      }
    }
    const int joined[] = {mark(1), mark(2)};
    const int sizes[] = {1, 1};
    const int g = rows.add(1, joined, sizes);
    rows.jacobian(g, 0)(0, 0) = 2.0;
    rows.jacobian(g, 1)(0, 0) = -2.0;
    rows.residual(g)(0) = 0.7;
    VectorXd line = VectorXd::Zero(parameters.size());
    line(parameters.block(joined[0]).offset) = 2.0;
    line(parameters.block(joined[1]).offset) = -2.0;
    lines.push_back(line);
    residuals.push_back(0.7);
    dense.resize(static_cast<Eigen::Index>(lines.size()), parameters.size());
    for (std::size_t i = 0; i < lines.size(); ++i) dense.row(static_cast<Eigen::Index>(i)) = lines[i];
    residual = Eigen::Map<VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
    shift = MatrixXd::Zero(parameters.size(), 1);
    for (const ParameterBlock& b : parameters.blocks()) shift(b.offset, 0) = 1.0;
  }

  /// The cofactors in the datum B'x = 0 from the bordered matrix, inverted densely.
  [[nodiscard]] MatrixXd bordered(const MatrixXd& conditions) const {
    const Eigen::Index u = dense.cols();
    const Eigen::Index d = conditions.cols();
    MatrixXd all = MatrixXd::Zero(u + d, u + d);
    all.topLeftCorner(u, u) = dense.transpose() * dense;
    all.topRightCorner(u, d) = conditions;
    all.bottomLeftCorner(d, u) = conditions.transpose();
    return all.fullPivLu().inverse().topLeftCorner(u, u);
  }
};

TEST(NormalEquations, CofactorsAreThoseOfTheBorderedMatrixInEveryDatum) {
  const LevellingNet net;
  const auto equations = NormalEquations::make(net.parameters, net.rows, net.shift);
  ASSERT_TRUE(equations) << equations.error().message;
  MatrixXd first_mark = MatrixXd::Zero(net.parameters.size(), 1);
  first_mark(0, 0) = 1.0;
  MatrixXd marks = net.shift;
  for (const ParameterBlock& block : net.parameters.blocks()) {
    if (block.role == BlockRole::kKept) marks(block.offset, 0) = 0.0;
  }
  for (const MatrixXd& conditions : {first_mark, marks, net.shift}) {
    const auto cofactors = Cofactors::make(*equations, conditions);
    ASSERT_TRUE(cofactors) << cofactors.error().message;
    const MatrixXd expected = net.bordered(conditions);
    EXPECT_LT((cofactors->full() - expected).norm(), 1e-12 * expected.norm());
    for (std::size_t a = 0; a < net.parameters.blocks().size(); ++a) {
      for (std::size_t b = 0; b < net.parameters.blocks().size(); ++b) {
        const auto& block_a = net.parameters.blocks()[a];
        const auto& block_b = net.parameters.blocks()[b];
        const MatrixXd part = expected.block(block_a.offset, block_b.offset, block_a.size(), block_b.size());
        EXPECT_LT((cofactors->block(static_cast<int>(a), static_cast<int>(b)) - part).norm(), 1e-12 * expected.norm());
      }
    }
    // What no datum may change: the cofactor of a height difference.
    VectorXd difference = VectorXd::Zero(net.parameters.size());
    difference(0) = 1.0;
    difference(1) = -1.0;
    EXPECT_NEAR(difference.dot(cofactors->full() * difference), difference.dot(net.bordered(net.shift) * difference), 1e-13);
  }
}

TEST(NormalEquations, StepMinimises) {
  const LevellingNet net;
  const auto equations = NormalEquations::make(net.parameters, net.rows, net.shift);
  ASSERT_TRUE(equations);
  const VectorXd remaining = net.residual + net.dense * equations->step();
  EXPECT_LT((net.dense.transpose() * remaining).norm(), 1e-12);
  const VectorXd expected = net.residual - net.dense * net.dense.completeOrthogonalDecomposition().solve(net.residual);
  EXPECT_LT((remaining - expected).norm(), 1e-12);
}

TEST(NormalEquations, RedundancyNumbersAreThoseOfTheResiduals) {
  const LevellingNet net;
  const auto equations = NormalEquations::make(net.parameters, net.rows, net.shift);
  ASSERT_TRUE(equations);
  const auto cofactors = residual_cofactors(*equations, net.rows);
  const MatrixXd expected =
      MatrixXd::Identity(net.dense.rows(), net.dense.rows()) - net.dense * net.bordered(net.shift) * net.dense.transpose();
  double sum = 0.0;
  for (int g = 0; g < net.rows.group_count(); ++g) {
    EXPECT_NEAR(cofactors[static_cast<std::size_t>(g)](0, 0), expected(g, g), 1e-12);
    sum += cofactors[static_cast<std::size_t>(g)].trace();
  }
  EXPECT_NEAR(sum, net.rows.row_count() - net.parameters.size() + 1, 1e-11);
}

TEST(NormalEquations, NamesWhatIsNotDetermined) {
  const LevellingNet net;
  // Without saying that the net may be shifted, its heights are not determined.
  const auto hanging = NormalEquations::make(net.parameters, net.rows, MatrixXd::Zero(net.parameters.size(), 0));
  ASSERT_FALSE(hanging);
  EXPECT_EQ(hanging.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_NE(hanging.error().message.find("instrument"), std::string::npos);

  // A tilt whose coefficients equal those of the height cannot be told from it.
  LevellingNet twin;
  for (int g = 0; g < 5; ++g) twin.rows.jacobian(g, 0)(0, 1) = twin.rows.jacobian(g, 0)(0, 0);
  const auto equations = NormalEquations::make(twin.parameters, twin.rows, twin.shift);
  ASSERT_FALSE(equations);
  EXPECT_NE(equations.error().message.find("instrument 0 tilt [rad]"), std::string::npos);
  EXPECT_EQ(equations.error().message.find("instrument 1"), std::string::npos);

  // Nothing observes it at all.
  LevellingNet blind;
  for (int g = 0; g < 5; ++g) blind.rows.jacobian(g, 0)(0, 1) = 0.0;
  const auto unseen = NormalEquations::make(blind.parameters, blind.rows, blind.shift);
  ASSERT_FALSE(unseen);
  EXPECT_NE(unseen.error().message.find("no observation depends on instrument 0 tilt [rad]"), std::string::npos);
}

TEST(NormalEquations, RefusesAFalseNullSpaceAndAnInsufficientDatum) {
  const LevellingNet net;
  MatrixXd wrong = net.shift;
  wrong(0, 0) = 2.0;
  EXPECT_EQ(NormalEquations::make(net.parameters, net.rows, wrong).error().code, base::ErrorCode::kInternal);
  const auto equations = NormalEquations::make(net.parameters, net.rows, net.shift);
  ASSERT_TRUE(equations);
  MatrixXd useless = MatrixXd::Zero(net.parameters.size(), 1);
  useless(0, 0) = 1.0;
  useless(1, 0) = -1.0;
  EXPECT_EQ(Cofactors::make(*equations, useless).error().code, base::ErrorCode::kNoUniqueSolution);
}

TEST(NormalEquations, WorksWithoutADatumDefect) {
  LevellingNet net(false);
  const int block[] = {0};
  const int size[] = {1};
  const int g = net.rows.add(1, block, size);
  net.rows.jacobian(g, 0)(0, 0) = 3.0;
  MatrixXd dense(net.dense.rows() + 1, net.dense.cols());
  dense << net.dense, MatrixXd::Zero(1, net.dense.cols());
  dense(dense.rows() - 1, 0) = 3.0;
  const MatrixXd none = MatrixXd::Zero(net.parameters.size(), 0);
  const auto equations = NormalEquations::make(net.parameters, net.rows, none);
  ASSERT_TRUE(equations) << equations.error().message;
  const auto cofactors = Cofactors::make(*equations, none);
  ASSERT_TRUE(cofactors);
  EXPECT_LT((cofactors->full() - (dense.transpose() * dense).inverse()).norm(), 1e-12);
}

}  // namespace
}  // namespace crosstie::math
