#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "base/result.h"
#include "math/parameters.h"
#include "math/whitened_rows.h"

namespace crosstie::math {

struct NormalEquationsOptions {
  /// The least eigenvalue that the reduced normal matrix, scaled to a unit diagonal, may have. Its inverse root is how much
  /// worse a combination of unknowns is known than each of them alone; beyond 1e5 half of the digits of a double are lost and a
  /// covariance would be a guess.
  double min_eigenvalue = 1e-10;
};

/// Least squares by normal equations, for unknowns with a datum defect.
///
/// Eliminated blocks that observations join to each other (two points and the bar between them) form one cell; cells are
/// independent of each other once the kept unknowns are fixed. With N = J'J in kept (k) and cell (c) parts the reduced matrix
/// is
///     S = N_kk - sum_c N_kc N_cc^-1 N_ck      (Schur complement),
/// scaled to unit diagonal by D, and made regular by the orthonormal basis U of the null space in the scaled kept unknowns:
///     M = D S D + U U',    Q = inverse of N in the datum U' D^-1 x_k = 0, plus a null-space part that every datum removes.
/// Cofactors (cofactors.h) carries Q over into any other datum.
class NormalEquations {
 public:
  /// A cell: eliminated blocks that were reduced together.
  struct Cell {
    std::vector<int> blocks;       ///< eliminated blocks, ascending
    std::vector<int> kept_blocks;  ///< kept blocks that share observations with it, ascending
    std::vector<int> columns;      ///< the kept unknowns of kept_blocks
    Eigen::MatrixXd inverse;       ///< N_cc^-1
    Eigen::MatrixXd elimination;   ///< N_cc^-1 N_ck, over `columns`
    int size = 0;
  };

  /// Builds, reduces and factorises. `null_space` has one column for each direction that no observation can determine
  /// (translations, rotations, scale of a free network); it may have none.
  ///
  /// Errors: kNoUniqueSolution where the unknowns are not determined up to that null space, naming the weak ones; kInternal
  /// where a column is not a null direction (an observation does determine it) or a value is not finite.
  static base::Result<NormalEquations> make(const Parameters& parameters, const WhitenedRows& rows,
                                            const Eigen::MatrixXd& null_space, const NormalEquationsOptions& options = {});

  /// The x that minimises |residual + J x| in the datum stated above.
  [[nodiscard]] Eigen::VectorXd step() const;
  /// Q * right for any right-hand sides over the full vector of unknowns.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

  [[nodiscard]] const Parameters& parameters() const { return parameters_; }
  [[nodiscard]] const Eigen::MatrixXd& null_space() const { return null_space_; }
  [[nodiscard]] const std::vector<Cell>& cells() const { return cells_; }
  /// The cell of an eliminated block and the offset of its first unknown in it.
  [[nodiscard]] std::pair<int, int> cell_of(int block) const { return cell_of_[static_cast<std::size_t>(block)]; }
  /// Q of the kept unknowns: the inverse, computed when it is first asked for. Not to be asked for by several threads at once.
  [[nodiscard]] const Eigen::MatrixXd& kept_cofactors() const;
  /// The least eigenvalue of M by inverse iteration, and the unknowns that dominate its eigenvector as text.
  [[nodiscard]] std::pair<double, std::string> weakest() const;
  /// Eigenvalues of M that fall below `limit`, as text that names the unknowns which dominate their eigenvectors.
  [[nodiscard]] std::vector<std::string> weak_directions(double limit) const;

 private:
  NormalEquations() = default;
  base::Result<> accumulate(const WhitenedRows& rows, Eigen::MatrixXd& reduced);
  /// reduced -= N_kc N_cc^-1 N_ck of one cell, in the lower triangle.
  void subtract_product(const Cell& cell, const Eigen::MatrixXd& coupling, Eigen::MatrixXd& reduced) const;
  [[nodiscard]] std::string dominant_unknowns(const Eigen::VectorXd& direction) const;
  base::Result<> factorise(Eigen::MatrixXd reduced, double min_eigenvalue);

  Parameters parameters_;
  Eigen::MatrixXd null_space_;
  std::vector<Cell> cells_;
  std::vector<std::pair<int, int>> cell_of_;
  std::vector<int> kept_index_;  ///< of the kept unknowns in the full vector
  Eigen::VectorXd gradient_;     ///< J'r
  Eigen::VectorXd scale_;        ///< D
  Eigen::MatrixXd scaled_;       ///< M
  Eigen::LLT<Eigen::MatrixXd> factor_;
  mutable Eigen::MatrixXd kept_cofactors_;  ///< empty until it is asked for
};

}  // namespace crosstie::math
