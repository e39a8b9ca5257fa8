#pragma once

#include <vector>

#include "math/detail/shape_solver.h"

namespace crosstie::math::detail {

/// Means of the products of [1, x, y, z, xx, xy, xz, yy, yz, zz]: all moments of the points up to the fourth order, with which an
/// algebraic fit costs the same for any number of points.
class Moments {
 public:
  using Matrix = Eigen::Matrix<double, 10, 10>;
  using Functional = Eigen::Matrix<double, 10, 1>;

  /// Of the points that take part.
  explicit Moments(const PointSet& points);

  [[nodiscard]] double mean(const Functional& a, const Functional& b) const { return a.dot(mean_ * b); }
  [[nodiscard]] double mean(const Functional& a) const { return a.dot(mean_.col(0)); }
  /// Covariance of the coordinates about their mean.
  [[nodiscard]] Eigen::Matrix3d scatter() const;
  [[nodiscard]] Eigen::Vector3d centroid() const { return mean_.block<3, 1>(1, 0); }

  static Functional constant();
  static Functional linear(const Eigen::Vector3d& direction);
  /// p'Ap of a symmetric A.
  static Functional quadratic(const Eigen::Matrix3d& a);

 private:
  Matrix mean_ = Matrix::Zero();
};

/// Shapes from algebraic fits, the most promising first; they are starts and no answers. `directions` is how finely the axes of
/// cylinders and cones are searched. Empty where the points are in one place.
[[nodiscard]] std::vector<ShapeState> start_states(ShapeKind kind, const PointSet& points, int directions);

/// The best local minimum that the starts lead to; nothing where none does.
[[nodiscard]] std::optional<ShapeSolution> best_solution(const ShapeProblem& problem, const PointSet& points, int directions);

}  // namespace crosstie::math::detail
