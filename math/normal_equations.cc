#include "math/normal_equations.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNullTolerance = 1e-7;   // |J g| over the sum of its terms' magnitudes: rounding gives 1e-15, an observation 1
constexpr double kCellTolerance = 1e-13;  // least over largest pivot of a cell

int root(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) i = parent[static_cast<std::size_t>(i)];
  return i;
}

/// Joins the eliminated blocks that share a group of rows; returns for each block the smallest block of its cell.
std::vector<int> join_cells(const Parameters& parameters, const WhitenedRows& rows) {
  std::vector<int> parent(parameters.blocks().size());
  std::iota(parent.begin(), parent.end(), 0);
  for (int g = 0; g < rows.group_count(); ++g) {
    int first = -1;
    for (const WhitenedRows::Term& term : rows.terms(g)) {
      if (parameters.block(term.block).role == BlockRole::kKept) continue;
      const int here = root(parent, term.block);
      if (first < 0) {
        first = here;
      } else {
        parent[static_cast<std::size_t>(std::max(first, here))] = std::min(first, here);
        first = std::min(first, here);
      }
    }
  }
  for (int& p : parent) p = root(parent, p);
  return parent;
}

/// The columns of a wide block that one group of rows depends on: of a splined lens some thirty out of hundreds.
struct SparsePart {
  bool sparse = false;
  std::vector<int> columns;
  MatrixXd compact;

  void take(const Eigen::Map<const WhitenedRows::Matrix>& jacobian) {
    constexpr Eigen::Index kWide = 32;
    sparse = jacobian.cols() > kWide;
    if (!sparse) return;
    columns.clear();
    for (Eigen::Index i = 0; i < jacobian.cols(); ++i) {
      if ((jacobian.col(i).array() != 0.0).any()) columns.push_back(static_cast<int>(i));
    }
    compact = jacobian(Eigen::all, columns);
  }
  [[nodiscard]] int place(Eigen::Index i) const { return sparse ? columns[static_cast<std::size_t>(i)] : static_cast<int>(i); }
};

/// place += left' right, over the columns that are not zero.
void add_sparse_product(const SparsePart& left, const Eigen::Map<const WhitenedRows::Matrix>& whole_left,
                        const SparsePart& right, const Eigen::Map<const WhitenedRows::Matrix>& whole_right,
                        Eigen::Block<MatrixXd> place) {
  const MatrixXd product =
      (left.sparse ? left.compact : MatrixXd(whole_left)).transpose() * (right.sparse ? right.compact : MatrixXd(whole_right));
  for (Eigen::Index j = 0; j < product.cols(); ++j) {
    for (Eigen::Index i = 0; i < product.rows(); ++i) place(left.place(i), right.place(j)) += product(i, j);
  }
}

Result<> check_null_space(const Parameters& parameters, const WhitenedRows& rows, const MatrixXd& null_space) {
  if (null_space.cols() == 0) return {};
  VectorXd defect = VectorXd::Zero(null_space.cols());
  VectorXd magnitude = VectorXd::Zero(null_space.cols());
  for (int g = 0; g < rows.group_count(); ++g) {
    MatrixXd product = MatrixXd::Zero(rows.group(g).rows, null_space.cols());
    MatrixXd sizes = product;
    const auto terms = rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      const auto part = null_space.middleRows(parameters.block(terms[t].block).offset, terms[t].size);
      product += rows.jacobian(g, t) * part;
      sizes += rows.jacobian(g, t).cwiseAbs() * part.cwiseAbs();
    }
    defect += product.colwise().squaredNorm().transpose();
    magnitude += sizes.colwise().squaredNorm().transpose();
  }
  for (Eigen::Index i = 0; i < defect.size(); ++i) {
    if (!(std::sqrt(defect(i)) <= kNullTolerance * std::sqrt(magnitude(i)))) {
      return fail(ErrorCode::kInternal, "normal equations: direction " + std::to_string(i + 1) +
                                            " of the null space is determined by an observation, or a value is not finite");
    }
  }
  return {};
}

}  // namespace

Result<NormalEquations> NormalEquations::make(const Parameters& parameters, const WhitenedRows& rows,
                                              const MatrixXd& null_space, const NormalEquationsOptions& options) {
  if (auto ok = check_null_space(parameters, rows, null_space); !ok) return fail(std::move(ok));
  NormalEquations equations;
  equations.parameters_ = parameters;
  equations.null_space_ = null_space;
  for (const ParameterBlock& block : parameters.blocks()) {
    if (block.role != BlockRole::kKept) continue;
    for (int i = 0; i < block.size(); ++i) equations.kept_index_.push_back(block.offset + i);
  }
  MatrixXd reduced;
  if (auto ok = equations.accumulate(rows, reduced); !ok) return fail(std::move(ok));
  if (auto ok = equations.factorise(std::move(reduced), options.min_eigenvalue); !ok) return fail(std::move(ok));
  return equations;
}

void NormalEquations::subtract_product(const Cell& cell, const MatrixXd& coupling, MatrixXd& reduced) const {
  const auto n = static_cast<Eigen::Index>(cell.columns.size());
  MatrixXd product = MatrixXd::Zero(n, n);
  product.triangularView<Eigen::Lower>() = coupling.transpose() * cell.elimination;
  Eigen::Index column = 0;
  for (std::size_t to = 0; to < cell.kept_blocks.size(); ++to) {
    const ParameterBlock& right = parameters_.block(cell.kept_blocks[to]);
    Eigen::Index row = column;
    for (std::size_t from = to; from < cell.kept_blocks.size(); ++from) {
      const ParameterBlock& left = parameters_.block(cell.kept_blocks[from]);
      reduced.block(left.role_offset, right.role_offset, left.size(), right.size()) -=
          product.block(row, column, left.size(), right.size());
      row += left.size();
    }
    column += right.size();
  }
}

Result<> NormalEquations::accumulate(const WhitenedRows& rows, MatrixXd& reduced) {
  const std::vector<int> smallest = join_cells(parameters_, rows);
  const auto block_count = parameters_.blocks().size();
  cell_of_.assign(block_count, {-1, 0});
  for (std::size_t b = 0; b < block_count; ++b) {
    if (parameters_.block(static_cast<int>(b)).role == BlockRole::kKept) continue;
    if (parameters_.block(static_cast<int>(b)).size() == 0) continue;  // all held
    const auto first = static_cast<std::size_t>(smallest[b]);
    if (first == b) {
      cell_of_[b].first = static_cast<int>(cells_.size());
      cells_.emplace_back();
    }
    Cell& cell = cells_[static_cast<std::size_t>(cell_of_[first].first)];
    cell_of_[b] = {cell_of_[first].first, cell.size};
    cell.blocks.push_back(static_cast<int>(b));
    cell.size += parameters_.block(static_cast<int>(b)).size();
  }

  const auto cell_of_group = [&](int g) {
    for (const WhitenedRows::Term& term : rows.terms(g)) {
      if (parameters_.block(term.block).role != BlockRole::kKept) return cell_of(term.block).first;
    }
    return -1;
  };
  for (int g = 0; g < rows.group_count(); ++g) {
    const int c = cell_of_group(g);
    if (c < 0) continue;
    for (const WhitenedRows::Term& term : rows.terms(g)) {
      if (parameters_.block(term.block).role == BlockRole::kKept)
        cells_[static_cast<std::size_t>(c)].kept_blocks.push_back(term.block);
    }
  }
  std::vector<MatrixXd> normal(cells_.size());
  std::vector<MatrixXd> coupling(cells_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    std::sort(cell.kept_blocks.begin(), cell.kept_blocks.end());
    cell.kept_blocks.erase(std::unique(cell.kept_blocks.begin(), cell.kept_blocks.end()), cell.kept_blocks.end());
    for (const int b : cell.kept_blocks) {
      for (int i = 0; i < parameters_.block(b).size(); ++i) cell.columns.push_back(parameters_.block(b).role_offset + i);
    }
    normal[c] = MatrixXd::Zero(cell.size, cell.size);
    coupling[c] = MatrixXd::Zero(cell.size, static_cast<Eigen::Index>(cell.columns.size()));
  }

  const int kept = parameters_.kept_size();
  reduced = MatrixXd::Zero(kept, kept);
  gradient_ = VectorXd::Zero(parameters_.size());
  std::vector<int> local_column(block_count, 0);  // of a kept block among the columns of the cell at hand
  int prepared = -1;
  std::vector<int> order(static_cast<std::size_t>(rows.group_count()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return cell_of_group(a) < cell_of_group(b); });
  std::vector<SparsePart> parts;
  for (const int g : order) {
    const int c = cell_of_group(g);
    if (c >= 0 && c != prepared) {
      int column = 0;
      for (const int b : cells_[static_cast<std::size_t>(c)].kept_blocks) {
        local_column[static_cast<std::size_t>(b)] = column;
        column += parameters_.block(b).size();
      }
      prepared = c;
    }
    const auto terms = rows.terms(g);
    parts.resize(terms.size());
    for (std::size_t s = 0; s < terms.size(); ++s) parts[s].take(rows.jacobian(g, s));
    for (std::size_t s = 0; s < terms.size(); ++s) {
      const ParameterBlock& from = parameters_.block(terms[s].block);
      const auto jacobian = rows.jacobian(g, s);
      gradient_.segment(from.offset, from.size()) += jacobian.transpose() * rows.residual(g);
      const bool from_kept = from.role == BlockRole::kKept;
      for (std::size_t t = 0; t < terms.size(); ++t) {
        const ParameterBlock& to = parameters_.block(terms[t].block);
        const bool to_kept = to.role == BlockRole::kKept;
        if (from_kept && !to_kept) continue;
        if (from_kept) {
          auto place = reduced.block(from.role_offset, to.role_offset, from.size(), to.size());
          if (parts[s].sparse || parts[t].sparse) {
            add_sparse_product(parts[s], rows.jacobian(g, s), parts[t], rows.jacobian(g, t), place);
          } else {
            place.noalias() += jacobian.transpose() * rows.jacobian(g, t);
          }
        } else if (to_kept) {
          auto place = coupling[static_cast<std::size_t>(c)].block(
              cell_of(terms[s].block).second, local_column[static_cast<std::size_t>(terms[t].block)], from.size(), to.size());
          if (parts[t].sparse) {
            add_sparse_product(parts[s], rows.jacobian(g, s), parts[t], rows.jacobian(g, t), place);
          } else {
            place.noalias() += jacobian.transpose() * rows.jacobian(g, t);
          }
        } else {
          normal[static_cast<std::size_t>(c)]
              .block(cell_of(terms[s].block).second, cell_of(terms[t].block).second, from.size(), to.size())
              .noalias() += jacobian.transpose() * rows.jacobian(g, t);
        }
      }
    }
  }

  for (int i = 0; i < kept; ++i) {
    if (!(reduced(i, i) > 0.0)) {
      return fail(ErrorCode::kNoUniqueSolution, "no observation depends on " +
                                                    parameters_.label(kept_index_[static_cast<std::size_t>(i)]) +
                                                    "; hold it fixed or leave it out");
    }
  }
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    const VectorXd scale = normal[c].diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LLT<MatrixXd> llt(scale.asDiagonal() * normal[c] * scale.asDiagonal());
    if (!scale.allFinite() || llt.info() != Eigen::Success || !(llt.rcond() > kCellTolerance)) {
      std::string names;
      for (const int b : cell.blocks) names += (names.empty() ? "" : ", ") + parameters_.block(b).name;
      return fail(ErrorCode::kNoUniqueSolution, "the observations do not determine " + names + " even if all else were known");
    }
    cell.inverse = scale.asDiagonal() * llt.solve(MatrixXd::Identity(cell.size, cell.size)) * scale.asDiagonal();
    cell.elimination.noalias() = cell.inverse * coupling[c];
    subtract_product(cell, coupling[c], reduced);
  }
  reduced.triangularView<Eigen::StrictlyUpper>() = reduced.transpose();
  return {};
}

Result<> NormalEquations::factorise(MatrixXd reduced, double min_eigenvalue) {
  const int kept = parameters_.kept_size();
  if (kept == 0) return {};
  const VectorXd diagonal = reduced.diagonal();
  // Elimination may leave nothing but rounding of a diagonal element; it is scaled as it is and found by the eigenvalues.
  scale_ = diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  scaled_ = scale_.asDiagonal() * reduced * scale_.asDiagonal();
  scaled_ = (0.5 * (scaled_ + scaled_.transpose())).eval();
  if (null_space_.cols() > 0) {
    MatrixXd basis(kept, null_space_.cols());
    for (int i = 0; i < kept; ++i) basis.row(i) = null_space_.row(kept_index_[static_cast<std::size_t>(i)]) / scale_(i);
    for (Eigen::Index i = 0; i < basis.cols(); ++i) basis.col(i) /= std::max(basis.col(i).norm(), 1e-300);
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(basis);
    if (std::abs(qr.matrixR()(basis.cols() - 1, basis.cols() - 1)) < 1e-9) {
      return fail(ErrorCode::kNoUniqueSolution,
                  "the kept unknowns cannot carry the datum: their positions coincide, or are too few, for the " +
                      std::to_string(basis.cols()) + " free directions of the network");
    }
    const MatrixXd u = qr.householderQ() * MatrixXd::Identity(kept, basis.cols());
    scaled_ += u * u.transpose();
  }
  factor_.compute(scaled_);
  const bool regular = factor_.info() == Eigen::Success && diagonal.minCoeff() > 0.0;
  if (regular && factor_.rcond() > min_eigenvalue) return {};
  const std::vector<std::string> weak = weak_directions(min_eigenvalue);
  if (regular && weak.empty()) return {};
  std::string message = "the observations do not determine the network:";
  for (const std::string& direction : weak) message += " " + direction + ";";
  if (weak.empty()) message += " the normal equations are not positive definite;";
  message.back() = '.';
  return fail(ErrorCode::kNoUniqueSolution, std::move(message));
}

std::string NormalEquations::dominant_unknowns(const VectorXd& direction) const {
  constexpr int kMaxNames = 5;
  const VectorXd share = direction.cwiseAbs2() / direction.squaredNorm();
  std::vector<int> order(static_cast<std::size_t>(share.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return share(a) > share(b); });
  std::string names;
  double named = 0.0;
  for (int i = 0; i < kMaxNames && i < static_cast<int>(order.size()) && named < 0.9; ++i) {
    const int at = order[static_cast<std::size_t>(i)];
    names += (names.empty() ? "" : " with ") + parameters_.label(kept_index_[static_cast<std::size_t>(at)]);
    named += share(at);
  }
  return names;
}

std::pair<double, std::string> NormalEquations::weakest() const {
  constexpr int kMaxIterations = 200;
  constexpr double kSettled = 1e-6;  // relative change of the eigenvalue
  if (scaled_.rows() == 0) return {1.0, ""};
  VectorXd direction = VectorXd::LinSpaced(scaled_.rows(), 1.0, 2.0).normalized();
  double value = 0.0;
  for (int i = 0; i < kMaxIterations; ++i) {
    const VectorXd next = factor_.solve(direction);
    const double before = value;
    value = 1.0 / next.norm();
    direction = next.normalized();
    if (std::abs(value - before) < kSettled * value) break;
  }
  return {value, dominant_unknowns(direction)};
}

std::vector<std::string> NormalEquations::weak_directions(double limit) const {
  constexpr int kMaxDirections = 3;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled_);
  std::vector<std::string> result;
  for (Eigen::Index k = 0; k < scaled_.rows() && eigen.eigenvalues()(k) < limit && k < kMaxDirections; ++k) {
    result.push_back(dominant_unknowns(eigen.eigenvectors().col(k)));
  }
  return result;
}

MatrixXd NormalEquations::solve(const MatrixXd& right) const {
  const int kept = parameters_.kept_size();
  MatrixXd right_kept(kept, right.cols());
  for (int i = 0; i < kept; ++i) right_kept.row(i) = right.row(kept_index_[static_cast<std::size_t>(i)]);
  std::vector<MatrixXd> right_cells;
  for (const Cell& cell : cells_) {
    MatrixXd& part = right_cells.emplace_back(cell.size, right.cols());
    for (const int b : cell.blocks) {
      part.middleRows(cell_of(b).second, parameters_.block(b).size()) =
          right.middleRows(parameters_.block(b).offset, parameters_.block(b).size());
    }
    const MatrixXd carried = cell.elimination.transpose() * part;
    for (std::size_t i = 0; i < cell.columns.size(); ++i)
      right_kept.row(cell.columns[i]) -= carried.row(static_cast<Eigen::Index>(i));
  }
  MatrixXd solution = MatrixXd::Zero(parameters_.size(), right.cols());
  MatrixXd x_kept(kept, right.cols());
  if (kept > 0) x_kept = scale_.asDiagonal() * factor_.solve(scale_.asDiagonal() * right_kept);
  for (int i = 0; i < kept; ++i) solution.row(kept_index_[static_cast<std::size_t>(i)]) = x_kept.row(i);
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    const Cell& cell = cells_[c];
    MatrixXd seen(static_cast<Eigen::Index>(cell.columns.size()), right.cols());
    for (std::size_t i = 0; i < cell.columns.size(); ++i) seen.row(static_cast<Eigen::Index>(i)) = x_kept.row(cell.columns[i]);
    const MatrixXd x_cell = cell.inverse * right_cells[c] - cell.elimination * seen;
    for (const int b : cell.blocks) {
      solution.middleRows(parameters_.block(b).offset, parameters_.block(b).size()) =
          x_cell.middleRows(cell_of(b).second, parameters_.block(b).size());
    }
  }
  return solution;
}

VectorXd NormalEquations::step() const { return -solve(gradient_); }

const MatrixXd& NormalEquations::kept_cofactors() const {
  const int kept = parameters_.kept_size();
  if (kept_cofactors_.size() == 0 && kept > 0) {
    const MatrixXd inverse = scale_.asDiagonal() * factor_.solve(MatrixXd::Identity(kept, kept)) * scale_.asDiagonal();
    kept_cofactors_ = 0.5 * (inverse + inverse.transpose());
  }
  return kept_cofactors_;
}

}  // namespace crosstie::math
