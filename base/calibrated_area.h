#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace crosstie::base {

/// Where in its image a lens model stands on observations: 10 x 10 equal cells inside of a border of 4 % of the image's shorter
/// side, which has cells of its own (one to each inner column and row, and the corners). A cell without observations is not
/// calibrated: the model is extrapolated there.
/// The border and the grid are those of BoofCV's calibration score (boofcv.org, ScoreCalibrationFill), with 10 border cells.
class CalibratedArea {
 public:
  static constexpr int kCells = 12;  ///< in a row and in a column, with the border

  CalibratedArea() = default;
  CalibratedArea(int width_px, int height_px);

  /// Counts a point; those that are not finite or lie outside of the image do not count.
  void add(const Eigen::Vector2d& point_px);
  /// Whether the cell of the point holds observations; false outside of the image.
  [[nodiscard]] bool contains(const Eigen::Vector2d& point_px) const;

  [[nodiscard]] int count(int column, int row) const { return counts_[static_cast<std::size_t>(row * kCells + column)]; }
  void set_count(int column, int row, int count) { counts_[static_cast<std::size_t>(row * kCells + column)] = count; }
  /// The outline [px] of the largest part whose cells hang together by their edges, holes filled; no corner where there is none.
  [[nodiscard]] std::vector<Eigen::Vector2d> outline_px() const;
  /// Left and right end of a column of cells [px]; the same of a row.
  [[nodiscard]] std::array<double, 2> column_px(int column) const;
  [[nodiscard]] std::array<double, 2> row_px(int row) const;
  /// Share of the inner cells, and of the border's, that hold observations, 0..1.
  [[nodiscard]] double inner_share() const;
  [[nodiscard]] double border_share() const;

  [[nodiscard]] int width_px() const { return width_px_; }
  [[nodiscard]] int height_px() const { return height_px_; }

 private:
  [[nodiscard]] double edge_px(int index, int size_px) const;
  [[nodiscard]] int cell_of(double at_px, int size_px) const;
  [[nodiscard]] double border_px() const;
  [[nodiscard]] double share(bool inner) const;

  int width_px_ = 0;
  int height_px_ = 0;
  std::array<int, kCells* kCells> counts_ = {};
};

}  // namespace crosstie::base
