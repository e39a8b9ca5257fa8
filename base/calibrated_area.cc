#include "base/calibrated_area.h"

#include <algorithm>
#include <cmath>

namespace crosstie::base {
namespace {

constexpr double kBorder = 0.04;  // of the shorter side

bool is_border(int column, int row) {
  constexpr int kLast = CalibratedArea::kCells - 1;
  return column == 0 || row == 0 || column == kLast || row == kLast;
}

}  // namespace

CalibratedArea::CalibratedArea(int width_px, int height_px) : width_px_(width_px), height_px_(height_px) {}

double CalibratedArea::border_px() const { return kBorder * std::min(width_px_, height_px_); }

double CalibratedArea::edge_px(int index, int size_px) const {
  if (index <= 0) return -0.5;
  if (index >= kCells) return size_px - 0.5;
  const double border = border_px();
  return -0.5 + border + (size_px - 2.0 * border) * (index - 1) / (kCells - 2);
}

int CalibratedArea::cell_of(double at_px, int size_px) const {
  if (!(at_px >= -0.5 && at_px <= size_px - 0.5)) return -1;
  const double border = border_px();
  const double inner = size_px - 2.0 * border;
  const double along = at_px + 0.5 - border;
  if (along < 0.0) return 0;
  if (along >= inner) return kCells - 1;
  return 1 + std::min(kCells - 3, static_cast<int>((kCells - 2) * along / inner));
}

void CalibratedArea::add(const Eigen::Vector2d& point_px) {
  const int column = cell_of(point_px.x(), width_px_);
  const int row = cell_of(point_px.y(), height_px_);
  if (column >= 0 && row >= 0) ++counts_[static_cast<std::size_t>(row * kCells + column)];
}

bool CalibratedArea::contains(const Eigen::Vector2d& point_px) const {
  const int column = cell_of(point_px.x(), width_px_);
  const int row = cell_of(point_px.y(), height_px_);
  return column >= 0 && row >= 0 && count(column, row) > 0;
}

std::array<double, 2> CalibratedArea::column_px(int column) const {
  return {edge_px(column, width_px_), edge_px(column + 1, width_px_)};
}

std::array<double, 2> CalibratedArea::row_px(int row) const { return {edge_px(row, height_px_), edge_px(row + 1, height_px_)}; }

double CalibratedArea::share(bool inner) const {
  int filled = 0;
  int all = 0;
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      if (is_border(column, row) == inner) continue;
      ++all;
      filled += count(column, row) > 0 ? 1 : 0;
    }
  }
  return static_cast<double>(filled) / all;
}

double CalibratedArea::inner_share() const { return share(true); }
double CalibratedArea::border_share() const { return share(false); }

}  // namespace crosstie::base
