#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "base/progress.h"
#include "base/result.h"
#include "math/model.h"
#include "math/normal_equations.h"

namespace crosstie::math {

/// A model at its minimum with the linear algebra of that place.
struct Solution {
  WhitenedRows rows;
  NormalEquations equations;
  double square_sum = 0.0;  ///< v'Pv
  int observations = 0;
  int unknowns = 0;
  int redundancy = 0;      ///< observations - unknowns + free directions
  double last_step = 0.0;  ///< |J dx| of the step at which it ended, in sigmas of all observations together
  int iterations = 0;

  /// A posteriori over a priori sigma; 0 without redundancy.
  [[nodiscard]] double sigma0() const;
  /// Of each group, whitened; computed when they are first asked for.
  [[nodiscard]] const std::vector<Eigen::MatrixXd>& residual_cofactors() const;

  mutable std::vector<Eigen::MatrixXd> residual_cofactors_ = {};  ///< empty until they are asked for
};

struct SolveOptions {
  int max_iterations = 100;  ///< of the damped method
  /// |J dx| of the last step, in sigmas of all observations together, at which it ends. Default: no digit that is written
  /// changes any more.
  double tolerance = 1e-9;
};

/// The directions of the full vector of unknowns that no observation determines, as columns, where the model is linearised as
/// `rows`.
using NullSpace = std::function<Eigen::MatrixXd(const Model& model, const WhitenedRows& rows)>;
/// Every unknown is determined.
[[nodiscard]] Eigen::MatrixXd no_null_space(const Model& model, const WhitenedRows& rows);

/// Least squares: moves `model` to the minimum of v'Pv. Gauss-Newton with the normal equations takes the last steps, so that the
/// result is at the minimum to rounding whatever took the first ones, and its covariance belongs to that place. Where
/// Gauss-Newton goes astray, the damped method (minimise.h) comes first. Errors: kNoUniqueSolution where the observations do not
/// determine the unknowns, naming the weak ones; kCancelled.
base::Result<Solution> solve(Model& model, const NullSpace& null_space, const SolveOptions& options,
                             const base::Progress& progress = {});

}  // namespace crosstie::math
