#pragma once

#include <optional>

#include "base/result.h"
#include "math/detail/shape_normals.h"

namespace crosstie::math::detail {

/// What is known of the radius, in the coordinates of the points.
struct SizeKnowledge {
  double size = 0.0;
  double sigma = 0.0;  ///< 0: held
};

struct ShapeProblem {
  ShapeKind kind = ShapeKind::kPlane;
  std::optional<SizeKnowledge> size;

  [[nodiscard]] bool holds_size() const { return size && size->sigma == 0.0; }
  [[nodiscard]] std::vector<int> unknowns() const;
};

struct ShapeSolution {
  ShapeState state;
  double square_sum = 0.0;
  int iterations = 0;
  bool converged = false;
  bool has_rivals = false;  ///< other shapes pass through the same points exactly
};

/// Levenberg-Marquardt from `start`, until steps are below 1e-8 or `damped_steps` are done.
[[nodiscard]] ShapeSolution solve_shape(const ShapeProblem& problem, const PointSet& points, const ShapeState& start,
                                        int damped_steps = 100);

/// From there Gauss-Newton to rounding.
void solve_to_rounding(const ShapeProblem& problem, const PointSet& points, ShapeSolution& solution);

/// Cofactors of the seven parameters at `state`, zero for those that are not estimated. Error kNoUniqueSolution where the normal
/// matrix is singular; the message names the parameter in the weakest combination.
[[nodiscard]] base::Result<Matrix7d> shape_cofactors(const ShapeProblem& problem, const PointSet& points,
                                                     const ShapeState& state);

}  // namespace crosstie::math::detail
