// Outlines by formula, and the saddle: in the hole's frame.
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "edge/detail/curve.h"

namespace crosstie::edge::detail {
namespace {

/// x and y with their derivatives.
struct Flat {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();
  Eigen::Vector2d derivative = Eigen::Vector2d::Zero();
};

/// By the angle phi = 2 pi t: r = ((|cos| / a)^n + (|sin| / b)^n)^(-1/n), smooth for n >= 2.
Flat superellipse(double a, double b, double n, double t) {
  const double phi = 2.0 * std::numbers::pi * t;
  const double c = std::cos(phi);
  const double s = std::sin(phi);
  const double u = std::abs(c) / a;
  const double w = std::abs(s) / b;
  const double g = std::pow(u, n) + std::pow(w, n);
  const double r = std::pow(g, -1.0 / n);
  const double dg =
      n * (std::pow(w, n - 1.0) * std::copysign(c, c * s) / b - std::pow(u, n - 1.0) * std::copysign(s, c * s) / a);
  const double dr = -r / (n * g) * (c * s == 0.0 ? 0.0 : dg);
  return {{r * c, r * s}, 2.0 * std::numbers::pi * Eigen::Vector2d(dr * c - r * s, dr * s + r * c)};
}

/// By arc length, from the middle of the right half circle on.
Flat stadium(double length, double width, double t) {
  const double r = 0.5 * width;
  const double straight = std::max(0.0, length - width);
  const double quarter = 0.5 * std::numbers::pi * r;
  const double all = 4.0 * quarter + 2.0 * straight;
  double s = (t - std::floor(t)) * all;
  const auto arc = [&](double side, double angle) {
    return Flat{{side * 0.5 * straight + r * std::cos(angle), r * std::sin(angle)},
                all * Eigen::Vector2d(-std::sin(angle), std::cos(angle))};
  };
  if (s < quarter) return arc(1.0, s / r);
  s -= quarter;
  if (s < straight) return {{0.5 * straight - s, r}, {-all, 0.0}};
  s -= straight;
  if (s < 2.0 * quarter) return arc(-1.0, 0.5 * std::numbers::pi + s / r);
  s -= 2.0 * quarter;
  if (s < straight) return {{s - 0.5 * straight, -r}, {all, 0.0}};
  return arc(1.0, 1.5 * std::numbers::pi + (s - straight) / r);
}

/// The tower's axis as the hole's frame sees it, from the generator and the normal at the origin.
struct Tower {
  explicit Tower(const Saddle& saddle)
      : side(saddle.radius_mm > 0.0 ? 1.0 : -1.0), radius(std::abs(saddle.radius_mm)), slope(std::tan(saddle.half_angle_rad)) {
    const Eigen::Vector3d generator(std::cos(saddle.direction_rad), std::sin(saddle.direction_rad), 0.0);
    const double c = std::cos(saddle.half_angle_rad);
    const double s = std::sin(saddle.half_angle_rad);
    direction = c * generator - side * s * Eigen::Vector3d::UnitZ();
    axis_point = -radius * (s * generator + side * c * Eigen::Vector3d::UnitZ());
    cosine = c;
    sine = s;
  }

  /// z of the surface over x, y: the root of |q|^2 - (d q)^2 = (R + d q tan)^2 nearest to 0; not a number where there is none.
  [[nodiscard]] double height(const Eigen::Vector2d& xy) const {
    const Eigen::Vector3d q = Eigen::Vector3d(xy.x(), xy.y(), 0.0) - axis_point;
    const double along = direction.dot(q);
    const double wide = radius + along * slope;
    const double dz = direction.z();
    const double a = 1.0 - dz * dz * (1.0 + slope * slope);
    const double half_b = q.z() - along * dz - slope * dz * wide;
    const double c = q.squaredNorm() - along * along - wide * wide;
    return -c / (half_b + std::copysign(std::sqrt(half_b * half_b - a * c), half_b));
  }

  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d q = p - axis_point;
    const Eigen::Vector3d radial = (q - direction.dot(q) * direction).normalized();
    return side * (cosine * radial - sine * direction);
  }

  double side;
  double radius;
  double slope;
  double cosine = 1.0;
  double sine = 0.0;
  Eigen::Vector3d direction;   ///< of the axis, to where the tower widens
  Eigen::Vector3d axis_point;  ///< nearest to the origin
};

}  // namespace

Jet outline_jet(const Nominal& nominal, const std::vector<double>& size_mm, double t) {
  Flat flat;
  switch (nominal.kind) {
    case NominalKind::kCircle:
      flat = superellipse(0.5 * size_mm[0], 0.5 * size_mm[0], 2.0, t);
      break;
    case NominalKind::kEllipse:
      flat = superellipse(0.5 * size_mm[0], 0.5 * size_mm[1], 2.0, t);
      break;
    case NominalKind::kSuperellipse:
      flat = superellipse(0.5 * size_mm[0], 0.5 * size_mm[1], nominal.exponent, t);
      break;
    case NominalKind::kOval:
      flat = stadium(size_mm[0], size_mm[1], t);
      break;
    case NominalKind::kPoints:
      break;
  }
  Jet jet;
  jet.point << flat.point, 0.0;
  jet.derivative << flat.derivative, 0.0;
  if (!nominal.saddle) return jet;
  const Tower tower(*nominal.saddle);
  jet.point.z() = tower.height(flat.point);
  jet.normal = tower.normal(jet.point);
  jet.derivative.z() = -jet.normal.head<2>().dot(flat.derivative) / jet.normal.z();
  return jet;
}

}  // namespace crosstie::edge::detail
