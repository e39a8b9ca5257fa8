#pragma once

#include <array>
#include <cstddef>

namespace crosstie::markers::detail {

/// Factors L D L' of a symmetric positive definite matrix of fixed small size: column by column, so that the inner loops run over
/// contiguous memory without a chain of sums.
template <std::size_t N>
class SmallCholesky {
 public:
  using Vector = std::array<double, N>;

  /// `lower` holds the columns' elements from the diagonal on: lower[column * N + row].
  explicit SmallCholesky(const std::array<double, N * N>& lower) : a_(lower) {
    for (std::size_t k = 0; k < N; ++k) {
      const double pivot = a_[k * N + k];
      if (!(pivot > 0.0)) {
        definite_ = false;
        return;
      }
      const double inverse = 1.0 / pivot;
      inverse_[k] = inverse;
      for (std::size_t j = k + 1; j < N; ++j) {
        const double factor = a_[k * N + j] * inverse;
        for (std::size_t i = j; i < N; ++i) a_[j * N + i] -= factor * a_[k * N + i];
      }
      for (std::size_t i = k + 1; i < N; ++i) a_[k * N + i] *= inverse;
    }
  }

  [[nodiscard]] bool definite() const { return definite_; }

  /// y with L y = b.
  [[nodiscard]] Vector forward(Vector y) const {
    for (std::size_t k = 0; k < N; ++k) {
      for (std::size_t i = k + 1; i < N; ++i) y[i] -= y[k] * a_[k * N + i];
    }
    return y;
  }

  /// x with L D L' x = b.
  [[nodiscard]] Vector solve(const Vector& b) const {
    Vector x = forward(b);
    for (std::size_t k = N; k-- > 0;) {
      double sum = x[k] * inverse_[k];
      for (std::size_t i = k + 1; i < N; ++i) sum -= a_[k * N + i] * x[i];
      x[k] = sum;
    }
    return x;
  }

  [[nodiscard]] double factor(std::size_t row, std::size_t column) const { return a_[column * N + row]; }  ///< of L
  [[nodiscard]] double pivot(std::size_t k) const { return 1.0 / inverse_[k]; }                            ///< of D

 private:
  std::array<double, N * N> a_;
  Vector inverse_{};
  bool definite_ = true;
};

}  // namespace crosstie::markers::detail
