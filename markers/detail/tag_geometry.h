#pragma once

#include <array>

#include <Eigen/Core>

#include "markers/tag_layout.h"

namespace crosstie::markers::detail {

using Corners = std::array<Eigen::Vector2d, 4>;

/// Pixel from cells and back, from the corners of the border square: (0, 0) is the upper left corner of the whole tag's first
/// cell, the border square runs from offset to offset + border_cells.
class TagFrame {
 public:
  TagFrame(const TagLayout& layout, const Corners& corners_px);

  [[nodiscard]] Eigen::Vector2d pixel(const Eigen::Vector2d& cell) const { return mapped(pixel_from_cell_, cell); }
  [[nodiscard]] Eigen::Vector2d cell(const Eigen::Vector2d& pixel) const { return mapped(cell_from_pixel_, pixel); }
  /// d cell / d pixel there.
  [[nodiscard]] Eigen::Matrix2d cell_by_pixel(const Eigen::Vector2d& pixel) const;
  /// Smallest width of a cell of the border square, across its longer sides.
  [[nodiscard]] double narrowest_cell_px(const TagLayout& layout) const;

 private:
  [[nodiscard]] static Eigen::Vector2d mapped(const Eigen::Matrix3d& h, const Eigen::Vector2d& p) {
    const Eigen::Vector3d q = h.leftCols<2>() * p + h.col(2);
    return q.head<2>() / q.z();
  }
  Eigen::Matrix3d pixel_from_cell_;
  Eigen::Matrix3d cell_from_pixel_;
};

/// Where the diagonals of a quadrangle meet: the image of the square's centre under any homography.
[[nodiscard]] Eigen::Vector2d meeting_of_diagonals(const Corners& corners_px);

/// Convex, clockwise as seen (y down), no side shorter than a pixel.
[[nodiscard]] bool is_proper(const Corners& corners_px);

}  // namespace crosstie::markers::detail
