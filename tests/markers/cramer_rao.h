#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Dense>

#include "tests/markers/rendered_marker.h"

namespace crosstie::tests {

/// The smallest covariance of the centre that noise of unit sigma allows: inverse of sum_i g_i g_i' over the pixels of dot and gap,
/// g_i the pixel's derivatives by centre, size, tilt, tilt axis, blur, both levels and the light's slope.
inline Eigen::Matrix2d cramer_rao_bound(const MarkerScene& scene) {
  constexpr int kUnknowns = 10;
  constexpr double kStep = 0.1;
  const auto changed = [&](int k, double by) {
    MarkerScene s = scene;
    if (k < 2) s.centre_px[k] += by;
    if (k == 2) s.radius_px += by;
    if (k == 3) s.blur_px += by;
    if (k == 4) s.dark_level += by;
    if (k == 5) s.bright_level += by;
    if (k == 6 || k == 7) s.light_slope[k - 6] += 0.01 * by;
    if (k == 8) s.tilt_rad += by / s.radius_px;
    if (k == 9) s.tilt_axis_rad += by / s.radius_px;
    return rendered(s);
  };
  // Seen from the front, tilt and axis change nothing to first order; elongation and centre are then uncorrelated by symmetry.
  const int unknowns = scene.tilt_rad > 0.0 ? kUnknowns : kUnknowns - 2;
  std::vector<std::vector<double>> derivatives;
  for (int k = 0; k < unknowns; ++k) {
    std::vector<double> up = changed(k, kStep);
    const std::vector<double> down = changed(k, -kStep);
    for (std::size_t i = 0; i < up.size(); ++i) up[i] = (up[i] - down[i]) / (2.0 * kStep);
    derivatives.push_back(std::move(up));
  }
  const double c = std::cos(scene.tilt_axis_rad);
  const double s = std::sin(scene.tilt_axis_rad);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(unknowns, unknowns);
  for (int y = 0; y < scene.height_px; ++y) {
    for (int x = 0; x < scene.width_px; ++x) {
      const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
      const double along = c * e.x() + s * e.y();
      const double across = (c * e.y() - s * e.x()) / std::cos(scene.tilt_rad);
      if (std::hypot(along, across) > scene.family.ring_inner * scene.radius_px) continue;
      Eigen::VectorXd g(unknowns);
      for (int k = 0; k < unknowns; ++k) {
        g[k] = derivatives[static_cast<std::size_t>(k)][static_cast<std::size_t>(y * scene.width_px + x)];
      }
      information += g * g.transpose();
    }
  }
  return information.inverse().topLeftCorner<2, 2>();
}

}  // namespace crosstie::tests
