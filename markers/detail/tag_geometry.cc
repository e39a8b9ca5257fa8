#include "markers/detail/tag_geometry.h"

#include <algorithm>
#include <limits>

#include <Eigen/LU>

namespace crosstie::markers::detail {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// The homography that takes (0, 0), (1, 0), (1, 1), (0, 1) to the corners, in closed form (Heckbert 1989, section 2.2.3).
Eigen::Matrix3d from_unit_square(const Corners& p) {
  const Eigen::Vector2d d1 = p[1] - p[2];
  const Eigen::Vector2d d2 = p[3] - p[2];
  const Eigen::Vector2d s = p[0] - p[1] + p[2] - p[3];
  const double g = cross(s, d2) / cross(d1, d2);
  const double h = cross(d1, s) / cross(d1, d2);
  Eigen::Matrix3d m;
  m << p[1].x() - p[0].x() + g * p[1].x(), p[3].x() - p[0].x() + h * p[3].x(), p[0].x(),  //
      p[1].y() - p[0].y() + g * p[1].y(), p[3].y() - p[0].y() + h * p[3].y(), p[0].y(),   //
      g, h, 1.0;
  return m;
}

}  // namespace

TagFrame::TagFrame(const TagLayout& layout, const Corners& corners_px) {
  Eigen::Matrix3d unit_from_cell = Eigen::Matrix3d::Identity();
  unit_from_cell.topLeftCorner<2, 2>() /= layout.border_cells;
  unit_from_cell.topRightCorner<2, 1>().setConstant(-static_cast<double>(layout.offset()) / layout.border_cells);
  pixel_from_cell_ = from_unit_square(corners_px) * unit_from_cell;
  cell_from_pixel_ = pixel_from_cell_.inverse();
}

Eigen::Matrix2d TagFrame::cell_by_pixel(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector3d q = cell_from_pixel_.leftCols<2>() * pixel + cell_from_pixel_.col(2);
  const Eigen::Vector2d at = q.head<2>() / q.z();
  return (cell_from_pixel_.topLeftCorner<2, 2>() - at * cell_from_pixel_.bottomLeftCorner<1, 2>()) / q.z();
}

double TagFrame::narrowest_cell_px(const TagLayout& layout) const {
  double narrowest = std::numeric_limits<double>::infinity();
  const int first = layout.offset();
  const int last = first + layout.border_cells - 1;
  for (const int y : {first, last}) {
    for (const int x : {first, last}) {
      const Eigen::Vector2d corner = pixel({x, y});
      const Eigen::Vector2d right = pixel({x + 1, y}) - corner;
      const Eigen::Vector2d down = pixel({x, y + 1}) - corner;
      narrowest = std::min(narrowest, cross(right, down) / std::max(right.norm(), down.norm()));
    }
  }
  return narrowest;
}

Eigen::Vector2d meeting_of_diagonals(const Corners& p) {
  const Eigen::Vector2d falling = p[2] - p[0];
  const Eigen::Vector2d rising = p[3] - p[1];
  return p[0] + cross(p[1] - p[0], rising) / cross(falling, rising) * falling;
}

bool is_proper(const Corners& p) {
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d side = p[(k + 1) % 4] - p[k];
    const Eigen::Vector2d next = p[(k + 2) % 4] - p[(k + 1) % 4];
    if (!side.allFinite() || side.norm() < 1.0 || !(cross(side, next) > 0.0)) return false;
  }
  return true;
}

}  // namespace crosstie::markers::detail
