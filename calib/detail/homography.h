#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"

namespace crosstie::calib::detail {

/// pixel ~ H (x, y, 1) of points in a plane, least squares in the pixels' algebraic distance after both sides were brought to
/// unit spread (Hartley & Zisserman, Multiple View Geometry, 2nd ed., alg. 4.2). At least four points.
struct Homography {
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  double rms_px = 0.0;  ///< of |e|
};
std::optional<Homography> fit_homography(const Eigen::Matrix2Xd& plane, const Eigen::Matrix2Xd& pixels);

/// The focal length of a camera with square pixels and its principal point at `centre`, from images of one plane (Zhang 2000): with
/// pixels counted from the centre, the first two columns of each H obey h1' B h2 = 0 and h1' B h1 = h2' B h2, B = diag(w, w, 1),
/// w = 1 / f^2. Nothing where the views are not tilted enough to tell.
std::optional<double> focal_from_homographies(const std::vector<Eigen::Matrix3d>& homographies, const Eigen::Vector2d& centre);

/// The pose of the plane from its homography and a pinhole of that focal length.
std::optional<base::Pose> plane_pose(const Eigen::Matrix3d& homography, double focal_px, const Eigen::Vector2d& centre);

}  // namespace crosstie::calib::detail
