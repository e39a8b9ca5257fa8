#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/progress.h"
#include "base/result.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/state.h"
#include "math/normal_equations.h"

namespace crosstie::bundle::detail {

/// A network at its minimum with the linear algebra of that place.
struct Estimate {
  NetworkModel network;
  math::WhitenedRows rows;
  math::NormalEquations equations;
  double square_sum = 0.0;  ///< v'Pv
  int observations = 0;
  int unknowns = 0;
  int redundancy = 0;      ///< observations - unknowns + free directions
  double last_step = 0.0;  ///< |J dx| of the step at which it ended, in sigmas of the whole network

  [[nodiscard]] double sigma0() const;
  /// Of each group, whitened; computed when they are first asked for.
  [[nodiscard]] const std::vector<Eigen::MatrixXd>& residual_cofactors() const;

  mutable std::vector<Eigen::MatrixXd> residual_cofactors_ = {};  ///< empty until they are asked for
};

struct EstimateOptions {
  int max_iterations = 100;
  /// |J dx| of the last step in sigmas of the whole network at which it ends. Default: no digit that is written changes any
  /// more.
  double tolerance = 1e-9;
};

/// The directions that no observation determines. Image points leave 3 translations, 3 rotations and the scale (in that order, as
/// columns); bars, control points and held coordinates, whose rows are `rows`, determine the scale, some of them, or all.
Eigen::MatrixXd null_space(const NetworkModel& network, const math::WhitenedRows& rows);

/// Minimises and moves `state` to the minimum. Gauss-Newton with the normal equations of math takes the last steps, so that the
/// result is at the minimum to rounding whatever took the first ones, and its covariance belongs to that place.
base::Result<Estimate> estimate(const Survey& survey, State& state, const ModelPlan& plan, const EstimateOptions& options,
                                const base::Progress& progress);

}  // namespace crosstie::bundle::detail
