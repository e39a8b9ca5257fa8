#include "math/shapes.h"

#include <cmath>

#include <Eigen/Geometry>

namespace crosstie::math {

Eigen::Vector3d Cone::apex_mm() const { return point_mm - direction * (distance_mm / std::sin(half_angle_rad)); }

double distance_mm(const Line& line, const Eigen::Vector3d& point_mm) {
  return line.direction.cross(point_mm - line.point_mm).norm();
}

double distance_mm(const Circle& circle, const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d from_centre = point_mm - circle.centre_mm;
  return std::hypot(circle.normal.cross(from_centre).norm() - circle.radius_mm, circle.normal.dot(from_centre));
}

double signed_distance_mm(const Plane& plane, const Eigen::Vector3d& point_mm) {
  return plane.normal.dot(point_mm - plane.point_mm);
}

double signed_distance_mm(const Sphere& sphere, const Eigen::Vector3d& point_mm) {
  return (point_mm - sphere.centre_mm).norm() - sphere.radius_mm;
}

double signed_distance_mm(const Cylinder& cylinder, const Eigen::Vector3d& point_mm) {
  return cylinder.direction.cross(point_mm - cylinder.point_mm).norm() - cylinder.radius_mm;
}

double signed_distance_mm(const Cone& cone, const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d from_point = point_mm - cone.point_mm;
  return cone.direction.cross(from_point).norm() * std::cos(cone.half_angle_rad) -
         cone.direction.dot(from_point) * std::sin(cone.half_angle_rad) - cone.distance_mm;
}

}  // namespace crosstie::math
