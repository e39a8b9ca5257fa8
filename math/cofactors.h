#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "math/normal_equations.h"

namespace crosstie::math {

/// Cofactors (covariances for sigma0 = 1) of the unknowns in a datum.
///
/// A datum is a set of conditions B'x = 0, as many as the null space G has columns; S = I - G (B'G)^-1 B' carries the cofactors
/// over from any datum (S-transformation, Baarda 1973; inner constraints: B = G over the chosen unknowns):
///     Q_B = S Q S'.
/// What every datum shares (distances, residuals, redundancy) is untouched by it.
class Cofactors {
 public:
  /// `conditions` is B over the full vector. Error kNoUniqueSolution where B'G is singular: the conditions leave a free
  /// direction. `equations` must outlive the object.
  static base::Result<Cofactors> make(const NormalEquations& equations, const Eigen::MatrixXd& conditions);

  /// Between the unknowns of two blocks.
  [[nodiscard]] Eigen::MatrixXd block(int a, int b) const;
  /// Of the unknowns of several blocks, in that order; blocks without unknowns take no room.
  [[nodiscard]] Eigen::MatrixXd joint(std::span<const int> blocks) const;
  /// Of all unknowns, in the order of Parameters: size^2 doubles.
  [[nodiscard]] Eigen::MatrixXd full() const;

 private:
  explicit Cofactors(const NormalEquations& equations) : equations_(&equations) {}
  [[nodiscard]] Eigen::MatrixXd raw_block(int a, int b) const;
  [[nodiscard]] Eigen::MatrixXd raw_full() const;

  const NormalEquations* equations_;
  Eigen::MatrixXd kept_;    ///< Q of the kept unknowns
  Eigen::MatrixXd g_;       ///< G (B'G)^-1
  Eigen::MatrixXd z_;       ///< Q B
  Eigen::MatrixXd middle_;  ///< B'Q B
};

/// For each group of rows the cofactors of its whitened residuals, I - J Q J': its diagonal holds the redundancy numbers, 0
/// where nothing controls the row, 1 where all else does. Their sum over all rows is the redundancy of the adjustment.
std::vector<Eigen::MatrixXd> residual_cofactors(const NormalEquations& equations, const WhitenedRows& rows);

}  // namespace crosstie::math
