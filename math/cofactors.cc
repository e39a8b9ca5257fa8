#include "math/cofactors.h"

#include <cmath>

#include <Eigen/LU>

namespace crosstie::math {
namespace {

using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;

/// Q between a cell's unknowns and the kept ones, Q_ck = -N_cc^-1 N_ck Q_kk.
MatrixXd cell_to_kept(const NormalEquations::Cell& cell, const MatrixXd& kept, Index first, Index count) {
  return -cell.elimination * kept(cell.columns, Eigen::seqN(first, count));
}

/// Q of one cell's own unknowns.
MatrixXd cell_to_itself(const NormalEquations::Cell& cell, const MatrixXd& kept) {
  return cell.inverse + cell.elimination * kept(cell.columns, cell.columns) * cell.elimination.transpose();
}

}  // namespace

Result<Cofactors> Cofactors::make(const NormalEquations& equations, const MatrixXd& conditions) {
  Cofactors cofactors(equations);
  cofactors.kept_ = equations.kept_cofactors();
  const MatrixXd& g = equations.null_space();
  if (g.cols() != conditions.cols()) {
    return fail(base::ErrorCode::kNoUniqueSolution, "datum: " + std::to_string(conditions.cols()) + " conditions for " +
                                                        std::to_string(g.cols()) + " free directions");
  }
  if (g.cols() > 0) {
    const Eigen::FullPivLU<MatrixXd> lu((conditions.transpose() * g).eval());
    if (!lu.isInvertible()) {
      return fail(base::ErrorCode::kNoUniqueSolution, "datum: the conditions leave a direction of the network free");
    }
    cofactors.g_ = g * lu.inverse();
    cofactors.z_ = equations.solve(conditions);
    cofactors.middle_ = conditions.transpose() * cofactors.z_;
  }
  return cofactors;
}

MatrixXd Cofactors::raw_block(int a, int b) const {
  const Parameters& parameters = equations_->parameters();
  const ParameterBlock& block_a = parameters.block(a);
  const ParameterBlock& block_b = parameters.block(b);
  const bool kept_a = block_a.role == BlockRole::kKept;
  const bool kept_b = block_b.role == BlockRole::kKept;
  if (kept_a && kept_b) return kept_.block(block_a.role_offset, block_b.role_offset, block_a.size(), block_b.size());
  if (kept_a) return raw_block(b, a).transpose();
  const auto [c, offset_a] = equations_->cell_of(a);
  const NormalEquations::Cell& cell_a = equations_->cells()[static_cast<std::size_t>(c)];
  const auto rows_a = cell_a.elimination.middleRows(offset_a, block_a.size());
  if (kept_b) return -rows_a * kept_(cell_a.columns, Eigen::seqN(block_b.role_offset, block_b.size()));
  const auto [d, offset_b] = equations_->cell_of(b);
  const NormalEquations::Cell& cell_b = equations_->cells()[static_cast<std::size_t>(d)];
  const auto rows_b = cell_b.elimination.middleRows(offset_b, block_b.size());
  MatrixXd q = rows_a * kept_(cell_a.columns, cell_b.columns) * rows_b.transpose();
  if (c == d) q += cell_a.inverse.block(offset_a, offset_b, block_a.size(), block_b.size());
  return q;
}

MatrixXd Cofactors::block(int a, int b) const {
  MatrixXd q = raw_block(a, b);
  if (g_.cols() == 0) return q;
  const Parameters& parameters = equations_->parameters();
  const auto part = [&](const MatrixXd& full, int block) {
    return full.middleRows(parameters.block(block).offset, parameters.block(block).size());
  };
  q -= part(g_, a) * part(z_, b).transpose();
  q -= part(z_, a) * part(g_, b).transpose();
  q += part(g_, a) * middle_ * part(g_, b).transpose();
  if (a == b) q = (0.5 * (q + q.transpose())).eval();
  return q;
}

MatrixXd Cofactors::joint(std::span<const int> blocks) const {
  const Parameters& parameters = equations_->parameters();
  Index size = 0;
  for (const int b : blocks) size += parameters.block(b).size();
  MatrixXd q(size, size);
  Index row = 0;
  for (const int a : blocks) {
    Index column = 0;
    if (parameters.block(a).size() == 0) continue;
    for (const int b : blocks) {
      if (parameters.block(b).size() == 0) continue;
      q.block(row, column, parameters.block(a).size(), parameters.block(b).size()) = block(a, b);
      column += parameters.block(b).size();
    }
    row += parameters.block(a).size();
  }
  return 0.5 * (q + q.transpose());
}

MatrixXd Cofactors::raw_full() const {
  // In the order kept, cells; the caller's order is restored at the end.
  const Parameters& parameters = equations_->parameters();
  const auto& cells = equations_->cells();
  const Index kept = parameters.kept_size();
  MatrixXd q(parameters.size(), parameters.size());
  q.topLeftCorner(kept, kept) = kept_;
  std::vector<Index> place(static_cast<std::size_t>(parameters.size()));
  for (const ParameterBlock& block : parameters.blocks()) {
    if (block.role != BlockRole::kKept) continue;
    for (int i = 0; i < block.size(); ++i) place[static_cast<std::size_t>(block.offset + i)] = block.role_offset + i;
  }
  Index row = kept;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const auto& cell = cells[c];
    q.block(row, 0, cell.size, kept) = cell_to_kept(cell, kept_, 0, kept);
    Index column = kept;
    for (std::size_t d = 0; d < c; ++d) {
      q.block(row, column, cell.size, cells[d].size) =
          -q(Eigen::seqN(row, cell.size), cells[d].columns) * cells[d].elimination.transpose();
      column += cells[d].size;
    }
    q.block(row, row, cell.size, cell.size) = cell_to_itself(cell, kept_);
    for (const int b : cell.blocks) {
      const ParameterBlock& block = parameters.block(b);
      const int offset = equations_->cell_of(b).second;
      for (int i = 0; i < block.size(); ++i) place[static_cast<std::size_t>(block.offset + i)] = row + offset + i;
    }
    row += cell.size;
  }
  q.triangularView<Eigen::StrictlyUpper>() = q.transpose();
  return q(place, place);
}

MatrixXd Cofactors::full() const {
  MatrixXd q = raw_full();
  if (g_.cols() > 0) {
    const MatrixXd mixed = g_ * z_.transpose();
    q -= mixed;
    q -= mixed.transpose();
    q += g_ * middle_ * g_.transpose();
  }
  return 0.5 * (q + q.transpose());
}

std::vector<MatrixXd> residual_cofactors(const NormalEquations& equations, const WhitenedRows& rows) {
  const Parameters& parameters = equations.parameters();
  const MatrixXd& kept = equations.kept_cofactors();
  // Q of each cell with the kept unknowns that it shares observations with, and with itself.
  std::vector<MatrixXd> shared;
  std::vector<MatrixXd> own;
  for (const NormalEquations::Cell& cell : equations.cells()) {
    const MatrixXd local = kept(cell.columns, cell.columns);
    shared.push_back(-cell.elimination * local);
    own.push_back(cell.inverse - shared.back() * cell.elimination.transpose());
  }
  std::vector<std::vector<int>> local_column(equations.cells().size());
  for (std::size_t c = 0; c < local_column.size(); ++c) {
    local_column[c].assign(parameters.blocks().size(), 0);
    int column = 0;
    for (const int b : equations.cells()[c].kept_blocks) {
      local_column[c][static_cast<std::size_t>(b)] = column;
      column += parameters.block(b).size();
    }
  }
  const auto between = [&](int a, int b) -> MatrixXd {
    const ParameterBlock& block_a = parameters.block(a);
    const ParameterBlock& block_b = parameters.block(b);
    const bool kept_a = block_a.role == BlockRole::kKept;
    const bool kept_b = block_b.role == BlockRole::kKept;
    if (kept_a && kept_b) return kept.block(block_a.role_offset, block_b.role_offset, block_a.size(), block_b.size());
    if (!kept_a && !kept_b) {
      const auto c = static_cast<std::size_t>(equations.cell_of(a).first);
      return own[c].block(equations.cell_of(a).second, equations.cell_of(b).second, block_a.size(), block_b.size());
    }
    const int eliminated = kept_a ? b : a;
    const int other = kept_a ? a : b;
    const auto [c, offset] = equations.cell_of(eliminated);
    const int column = local_column[static_cast<std::size_t>(c)][static_cast<std::size_t>(other)];
    const auto part = shared[static_cast<std::size_t>(c)].block(offset, column, parameters.block(eliminated).size(),
                                                                parameters.block(other).size());
    if (kept_a) return part.transpose();
    return part;
  };

  std::vector<MatrixXd> result;
  result.reserve(static_cast<std::size_t>(rows.group_count()));
  for (int g = 0; g < rows.group_count(); ++g) {
    const int m = rows.group(g).rows;
    MatrixXd cofactor = MatrixXd::Identity(m, m);
    const auto terms = rows.terms(g);
    for (std::size_t s = 0; s < terms.size(); ++s) {
      for (std::size_t t = 0; t < terms.size(); ++t) {
        cofactor -= rows.jacobian(g, s) * between(terms[s].block, terms[t].block) * rows.jacobian(g, t).transpose();
      }
    }
    result.push_back(0.5 * (cofactor + cofactor.transpose()));
  }
  return result;
}

}  // namespace crosstie::math
