#pragma once

#include "math/detail/shape_state.h"

namespace crosstie::math::detail {

/// Of the change of all seven parameters: N x = g minimises v'Pv to first order.
struct ShapeNormals {
  Matrix7d matrix = Matrix7d::Zero();
  Vector7d right = Vector7d::Zero();
  double square_sum = 0.0;       ///< v'Pv
  bool weights_are_good = true;  ///< false: a point's covariance along its residual is not positive
};

/// Accumulated point by point; nothing of the size of the points is held.
[[nodiscard]] ShapeNormals shape_normals(ShapeKind kind, const ShapeState& state, const PointSet& points);

/// A point's residual: shape to point, signed for surfaces, length for curves.
[[nodiscard]] double shape_residual(ShapeKind kind, const ShapeState& state, const Eigen::Vector3d& point);

/// v'Q^-1 v of one point's residuals with the cofactors Q = C -/+ J N^-1 J' of a point that took part or did not; C is the
/// point's own variance. Divided by the number of rows its root is |w|.
[[nodiscard]] double standardised_square(ShapeKind kind, const ShapeState& state, const PointSet& points, Eigen::Index i,
                                         const Matrix7d& cofactor, bool took_part);

}  // namespace crosstie::math::detail
