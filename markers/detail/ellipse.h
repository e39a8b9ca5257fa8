#pragma once

#include <optional>

#include <Eigen/Core>

namespace crosstie::markers::detail {

/// An ellipse in pixels; the angle of the major axis runs from x towards y and lies in (-pi/2, pi/2].
struct Ellipse {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double semi_major_px = 0.0;
  double semi_minor_px = 0.0;
  double angle_rad = 0.0;

  /// The M with pixel = centre + M u for u on the unit circle; det M > 0: clockwise in u is clockwise in the image.
  [[nodiscard]] Eigen::Matrix2d pixel_from_unit() const;
  /// The A with (p - centre)^T A (p - centre) = 1 on the ellipse.
  [[nodiscard]] Eigen::Matrix2d shape() const;
  /// Half the width and height of the upright box around the ellipse.
  [[nodiscard]] Eigen::Vector2d half_extent_px() const;

  /// Nothing where A is not positive definite.
  [[nodiscard]] static std::optional<Ellipse> from_shape(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& shape);
  /// The ellipse of uniform density with these second central moments [px^2]; nothing where they are not positive definite.
  [[nodiscard]] static std::optional<Ellipse> from_moments(const Eigen::Vector2d& centre_px, const Eigen::Matrix2d& moments);
};

}  // namespace crosstie::markers::detail
