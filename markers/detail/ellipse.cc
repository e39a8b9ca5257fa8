#include "markers/detail/ellipse.h"

#include <cmath>
#include <numbers>

namespace crosstie::markers::detail {
namespace {

/// Eigenvalues, larger one first, and the angle of its eigenvector in (-pi/2, pi/2], of a symmetric 2x2 matrix.
struct Axes {
  double large, small, angle_rad;
};

Axes axes_of(const Eigen::Matrix2d& m) {
  const double mean = 0.5 * (m(0, 0) + m(1, 1));
  const double half_difference = 0.5 * (m(0, 0) - m(1, 1));
  const double root = std::hypot(half_difference, m(0, 1));
  return {mean + root, mean - root, 0.5 * std::atan2(m(0, 1), half_difference)};
}

double wrapped(double angle_rad) {
  if (angle_rad > 0.5 * std::numbers::pi) return angle_rad - std::numbers::pi;
  if (angle_rad <= -0.5 * std::numbers::pi) return angle_rad + std::numbers::pi;
  return angle_rad;
}

}  // namespace

Eigen::Matrix2d Ellipse::pixel_from_unit() const {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  Eigen::Matrix2d m;
  m << c * semi_major_px, -s * semi_minor_px, s * semi_major_px, c * semi_minor_px;
  return m;
}

Eigen::Matrix2d Ellipse::shape() const {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  const double p = 1.0 / (semi_major_px * semi_major_px);
  const double q = 1.0 / (semi_minor_px * semi_minor_px);
  Eigen::Matrix2d a;
  a << c * c * p + s * s * q, c * s * (p - q), c * s * (p - q), s * s * p + c * c * q;
  return a;
}

Eigen::Vector2d Ellipse::half_extent_px() const {
  const Eigen::Matrix2d m = pixel_from_unit();
  return {std::hypot(m(0, 0), m(0, 1)), std::hypot(m(1, 0), m(1, 1))};
}

std::optional<Ellipse> Ellipse::from_shape(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& shape) {
  const Axes axes = axes_of(shape);
  if (!(axes.small > 0.0) || !std::isfinite(axes.large)) return std::nullopt;
  return Ellipse{centre_px, 1.0 / std::sqrt(axes.small), 1.0 / std::sqrt(axes.large),
                 wrapped(axes.angle_rad + 0.5 * std::numbers::pi)};
}

std::optional<Ellipse> Ellipse::from_moments(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& moments) {
  const Axes axes = axes_of(moments);
  if (!(axes.small > 0.0) || !std::isfinite(axes.large)) return std::nullopt;
  return Ellipse{centre_px, 2.0 * std::sqrt(axes.large), 2.0 * std::sqrt(axes.small), wrapped(axes.angle_rad)};
}

}  // namespace crosstie::markers::detail
