#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calib/detail/board_model.h"
#include "math/solution.h"

namespace crosstie::calib::detail {

/// The minimum, its linear algebra, and the shares of corners and prior in it.
struct Estimate {
  BoardModel network;
  math::Solution solution;
  double corner_square_sum = 0.0;  ///< v'Pv of the corners
  double prior_square_sum = 0.0;
  int corner_rows = 0;
  double corner_redundancy = 0.0;
  double prior_redundancy = 0.0;

  /// By which the sigma of the corners must be multiplied for their v'Pv to equal their redundancy.
  [[nodiscard]] double sigma_factor() const;
};

/// Least squares of all that takes part; the state receives the result. `tolerance`: see math::SolveOptions.
base::Result<Estimate> estimate(const Problem& problem, State& state, const ModelPlan& plan, double tolerance,
                                const base::Progress& progress);

/// The same with the corners' sigma in balance with their residuals, to a relative 1e-4.
base::Result<Estimate> estimate_with_sigma(const Problem& problem, State& state, const ModelPlan& plan,
                                           const base::Progress& progress);

}  // namespace crosstie::calib::detail
