#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace crosstie::scan::detail {

/// L D L' of a symmetric positive matrix of at most kMost rows, on the stack: for equations of a few unknowns that are solved some million
/// times.
template <std::size_t kMost>
class SmallFactor {
 public:
  using Matrix = std::array<std::array<double, kMost>, kMost>;  ///< its lower triangle counts
  using Vector = std::array<double, kMost>;

  SmallFactor(const Matrix& matrix, std::size_t size) : lower_(matrix), size_(std::min(size, kMost)) {
    for (std::size_t j = 0; j < size_; ++j) {
      double pivot = matrix[j][j];
      for (std::size_t k = 0; k < j; ++k) pivot -= lower_[j][k] * lower_[j][k] * pivots_[k];
      pivots_[j] = pivot;
      for (std::size_t i = j + 1; i < size_; ++i) {
        double sum = matrix[i][j];
        for (std::size_t k = 0; k < j; ++k) sum -= lower_[i][k] * lower_[j][k] * pivots_[k];
        lower_[i][j] = sum / pivot;
      }
    }
  }

  [[nodiscard]] bool pivots_exceed(double least) const {
    for (std::size_t j = 0; j < size_; ++j) {
      if (!(pivots_[j] > least)) return false;
    }
    return true;
  }

  [[nodiscard]] Vector solve(Vector right) const {
    for (std::size_t i = 0; i < size_; ++i) {
      for (std::size_t k = 0; k < i; ++k) right[i] -= lower_[i][k] * right[k];
    }
    for (std::size_t i = size_; i-- > 0;) {
      right[i] /= pivots_[i];
      for (std::size_t k = i + 1; k < size_; ++k) right[i] -= lower_[k][i] * right[k];
    }
    return right;
  }

 private:
  Matrix lower_;
  Vector pivots_ = {};
  std::size_t size_;
};

}  // namespace crosstie::scan::detail
