#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace crosstie::math::detail {

enum class ShapeKind { kLine, kPlane, kCircle, kSphere, kCylinder, kCone };

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

/// Columns of the seven parameters of shape_fit.h.
enum Parameter { kU, kV, kW, kA, kB, kSize, kAngle };

/// Any shape, in the coordinates of a PointSet.
struct ShapeState {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< e1, e2, e3 = direction in columns
  double size = 0.0;                                   ///< radius; of a cone: distance of the origin from the surface
  double angle = 0.0;                                  ///< half angle of a cone
};

/// Points about their centroid, scaled to a spread near one.
struct PointSet {
  Eigen::Matrix3Xd xyz;
  std::vector<Eigen::Matrix3d> cov;  ///< empty: all points have `sigma`
  double sigma = 1.0;
  std::vector<char> active;                            ///< empty: all take part
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< of those that take part

  [[nodiscard]] bool takes_part(Eigen::Index i) const { return active.empty() || active[static_cast<std::size_t>(i)] != 0; }
  [[nodiscard]] Eigen::Index count() const;
  void update_centroid();
  /// At most `count` of the points that take part, evenly spread over the list; one sigma, the mean one, in place of covariances:
  /// a shape that is far from the right one would be weighted wrongly.
  [[nodiscard]] PointSet thinned(Eigen::Index count) const;
};

[[nodiscard]] std::string name_of(ShapeKind kind);
[[nodiscard]] std::vector<int> parameters_of(ShapeKind kind);
[[nodiscard]] int rows_of(ShapeKind kind);  ///< observations per point

/// Right-handed axes with the third along `direction`.
[[nodiscard]] Eigen::Matrix3d axes_along(const Eigen::Vector3d& direction);

/// The state after a change of its parameters; its origin moved to where it is nearest to `centroid`.
[[nodiscard]] ShapeState changed(ShapeKind kind, ShapeState state, const Vector7d& change, const Eigen::Vector3d& centroid);

/// The same shape with the direction's largest component positive; cones and spheres stay as they are.
[[nodiscard]] ShapeState with_sign(ShapeKind kind, ShapeState state);

}  // namespace crosstie::math::detail
