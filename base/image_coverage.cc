#include "base/image_coverage.h"

#include <algorithm>
#include <cmath>

namespace crosstie::base {
namespace {

constexpr int kCellsAcross = 12;

}  // namespace

ImageCells::ImageCells(int width_px, int height_px) {
  const double width = std::max(1, width_px);
  const double height = std::max(1, height_px);
  columns_ = kCellsAcross;
  rows_ = std::clamp(static_cast<int>(std::lround(kCellsAcross * height / width)), 1, 4 * kCellsAcross);
  cell_px_ = {width / columns_, height / rows_};
}

std::size_t ImageCells::cell_of(const Eigen::Vector2d& point_px) const {
  const auto column = static_cast<int>(std::clamp(std::floor((point_px.x() + 0.5) / cell_px_.x()), 0.0, columns_ - 1.0));
  const auto row = static_cast<int>(std::clamp(std::floor((point_px.y() + 0.5) / cell_px_.y()), 0.0, rows_ - 1.0));
  return static_cast<std::size_t>(row * columns_ + column);
}

double covered_share(const ImageCells& cells, const std::vector<Eigen::Vector2d>& points_px) {
  std::vector<char> held(cells.size(), 0);
  for (const Eigen::Vector2d& point : points_px) {
    if (point.allFinite()) held[cells.cell_of(point)] = 1;
  }
  return static_cast<double>(std::count(held.begin(), held.end(), 1)) / static_cast<double>(held.size());
}

}  // namespace crosstie::base
