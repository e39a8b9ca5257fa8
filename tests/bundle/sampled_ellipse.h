#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Dense>

#include "base/camera.h"
#include "base/pose.h"

namespace crosstie::tests {

/// The conic through the images of points on a circle, found without any formula for projected circles.
struct SampledEllipse {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape_px2 = Eigen::Matrix2d::Zero();  ///< its points are centre + sqrt(shape) (cos t, sin t)
};

inline SampledEllipse ellipse_through(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) mean += point / static_cast<double>(points.size());
  // a x^2 + b x y + c y^2 + d x + e y = 1 about the mean
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(points.size()), 5);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d p = points[i] - mean;
    rows.row(static_cast<Eigen::Index>(i)) << p.x() * p.x(), p.x() * p.y(), p.y() * p.y(), p.x(), p.y();
  }
  const Eigen::VectorXd conic = rows.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(rows.rows()));
  Eigen::Matrix2d quadratic;
  quadratic << conic(0), 0.5 * conic(1), 0.5 * conic(1), conic(2);
  const Eigen::Vector2d centre = -0.5 * quadratic.inverse() * conic.tail<2>();
  const double level = 1.0 + centre.dot(quadratic * centre);
  return {mean + centre, (quadratic / level).inverse()};
}

/// Points on the rim of a circle (in network) as a camera sees them; empty where one of them is not seen.
inline std::vector<Eigen::Vector2d> rim_px(const base::Camera& camera, const base::Pose& camera_from_network,
                                           const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, double radius_mm,
                                           int count = 60) {
  const Eigen::Vector3d u = normal.unitOrthogonal();
  const Eigen::Vector3d v = normal.normalized().cross(u);
  std::vector<Eigen::Vector2d> rim;
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / count;
    const auto pixel = camera.project(camera_from_network * (centre + radius_mm * (std::cos(angle) * u + std::sin(angle) * v)));
    if (!pixel) return {};
    rim.push_back(*pixel);
  }
  return rim;
}

}  // namespace crosstie::tests
