#pragma once

#include <Eigen/Core>

namespace crosstie::math {

// Shapes as metrology has them: unbounded, directions of unit length, lengths in mm, in the frame of the points that they were
// fitted to. `signed_distance_mm` is the orthogonal distance of a point, positive outside (of a plane: on the normal's side).

struct Line {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

struct Plane {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// In space: a curve.
struct Circle {
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double radius_mm = 0.0;
};

struct Sphere {
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  double radius_mm = 0.0;
};

struct Cylinder {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< on the axis
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double radius_mm = 0.0;
};

/// The nappe that opens along `direction`. A point of the axis with its orthogonal distance from the surface, and not the apex,
/// stands for the place: the apex of a nearly cylindrical cone is far away and hardly known.
struct Cone {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();    ///< on the axis
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< to where it widens
  double distance_mm = 0.0;                              ///< of point_mm from the surface; negative before the apex
  double half_angle_rad = 0.0;                           ///< between axis and surface, 0 to pi / 2

  [[nodiscard]] Eigen::Vector3d apex_mm() const;
};

/// Lines and circles are curves: their distances are never negative.
[[nodiscard]] double distance_mm(const Line& line, const Eigen::Vector3d& point_mm);
[[nodiscard]] double distance_mm(const Circle& circle, const Eigen::Vector3d& point_mm);
[[nodiscard]] double signed_distance_mm(const Plane& plane, const Eigen::Vector3d& point_mm);
[[nodiscard]] double signed_distance_mm(const Sphere& sphere, const Eigen::Vector3d& point_mm);
[[nodiscard]] double signed_distance_mm(const Cylinder& cylinder, const Eigen::Vector3d& point_mm);
/// From the surface's straight continuation beyond the apex, where a point lies there.
[[nodiscard]] double signed_distance_mm(const Cone& cone, const Eigen::Vector3d& point_mm);

}  // namespace crosstie::math
