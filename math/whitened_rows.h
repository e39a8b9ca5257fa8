#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace crosstie::math {

/// Linearised observations, whitened: every row is divided by the (Cholesky factor of the) a priori sigma, so that the sum of
/// squares is v'Pv. Rows come in groups that were measured together, such as the two coordinates of an image point; the rows of
/// a group may have been correlated, groups are independent.
///
/// residual = predicted - measured; jacobian = d residual / d block, one dense matrix for each block that the group depends on.
class WhitenedRows {
 public:
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  struct Term {
    int block = 0;  ///< index into Parameters
    int size = 0;   ///< unknowns of that block
    std::size_t values = 0;
  };
  struct Group {
    int rows = 0;
    std::size_t first_residual = 0;
    std::size_t first_term = 0;
    std::size_t term_count = 0;
  };

  /// Adds a group of zeros and returns its index; `blocks` and `sizes` name what it depends on, each block once.
  int add(int rows, std::span<const int> blocks, std::span<const int> sizes);

  [[nodiscard]] int group_count() const { return static_cast<int>(groups_.size()); }
  [[nodiscard]] int row_count() const { return static_cast<int>(residuals_.size()); }
  [[nodiscard]] const Group& group(int index) const { return groups_[static_cast<std::size_t>(index)]; }
  [[nodiscard]] std::span<const Term> terms(int group_index) const;

  [[nodiscard]] Eigen::Map<Eigen::VectorXd> residual(int group_index);
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> residual(int group_index) const;
  [[nodiscard]] Eigen::Map<Matrix> jacobian(int group_index, std::size_t term);
  [[nodiscard]] Eigen::Map<const Matrix> jacobian(int group_index, std::size_t term) const;

  /// v'Pv.
  [[nodiscard]] double square_sum() const;

 private:
  std::vector<Group> groups_;
  std::vector<Term> terms_;
  std::vector<double> residuals_;
  std::vector<double> values_;
};

}  // namespace crosstie::math
