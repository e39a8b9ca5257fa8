#pragma once

#include "base/result.h"
#include "math/detail/shape_solver.h"
#include "math/shape_fit.h"

namespace crosstie::math::detail {

/// Least number of points that give a shape.
[[nodiscard]] Eigen::Index least_points(ShapeKind kind);

/// The shape on which most of the points agree, a contrario: of shapes through few points, drawn at random with a fixed seed, the
/// one whose nearest points are the least to be expected if all points were spread over the volume that they fill,
///     NFA(k) = (n - m) C(n, k) C(k, m) p_k^(k - m),    p_k = 2 r_k / D (of curves: its square)
/// with m points drawn, r_k the distance of the k-th nearest and D the points' extent (Moisan & Stival, IJCV 57(3), 2004). Sets
/// `points.active` to those that agree. Error kNoUniqueSolution where no shape is better than chance.
base::Result<ShapeState> consensus(const ShapeProblem& problem, PointSet& points);

/// Lets points go and come back by their standardised residuals until nothing changes; `points.active` and `state` are start
/// and outcome. `sigma_is_known`: the points' sigmas are a priori, else they follow from the residuals (Pope's tau then).
base::Result<> reject_residuals(const ShapeProblem& problem, double max_w, bool sigma_is_known, PointSet& points,
                                ShapeState& state);

}  // namespace crosstie::math::detail
