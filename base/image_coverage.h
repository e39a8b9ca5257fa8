#pragma once

#include <vector>

#include <Eigen/Core>

namespace crosstie::base {

/// An image divided into nearly square cells, 12 across, to tell which parts of it hold points: where none are, a lens model is
/// extrapolated. Points in px, (0, 0) the centre of the first pixel; those outside of the image count to its border's cells.
class ImageCells {
 public:
  ImageCells(int width_px, int height_px);

  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }
  /// Width and height of a cell [px].
  [[nodiscard]] const Eigen::Vector2d& cell_px() const { return cell_px_; }
  /// The cell of a point that is finite, row by row.
  [[nodiscard]] std::size_t cell_of(const Eigen::Vector2d& point_px) const;

 private:
  int columns_ = 1;
  int rows_ = 1;
  Eigen::Vector2d cell_px_ = Eigen::Vector2d::Ones();
};

/// Share of the cells that hold at least one of these points, 0..1. Points that are not finite do not count.
[[nodiscard]] double covered_share(const ImageCells& cells, const std::vector<Eigen::Vector2d>& points_px);

}  // namespace crosstie::base
