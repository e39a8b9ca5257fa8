#pragma once

#include <Eigen/Core>

namespace crosstie::base::detail {

/// COLMAP counts pixels from the image's corner, so that the centre of its first pixel is (0.5, 0.5); ours is (0, 0).
inline constexpr double kColmapPixelShift = 0.5;

[[nodiscard]] inline double from_colmap_pixel(double coordinate_px) { return coordinate_px - kColmapPixelShift; }
[[nodiscard]] inline double to_colmap_pixel(double coordinate_px) { return coordinate_px + kColmapPixelShift; }

[[nodiscard]] inline Eigen::Vector2d from_colmap_pixel(const Eigen::Vector2d& pixel_px) {
  return pixel_px.array() - kColmapPixelShift;
}
[[nodiscard]] inline Eigen::Vector2d to_colmap_pixel(const Eigen::Vector2d& pixel_px) {
  return pixel_px.array() + kColmapPixelShift;
}

}  // namespace crosstie::base::detail
