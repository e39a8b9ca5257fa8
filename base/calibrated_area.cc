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

constexpr int kCells = CalibratedArea::kCells;
using Cells = std::array<char, static_cast<std::size_t>(kCells* kCells)>;

bool holds(const Cells& cells, int column, int row) {
  return column >= 0 && row >= 0 && column < kCells && row < kCells &&
         cells[static_cast<std::size_t>(row * kCells + column)] != 0;
}

/// The cells that hang together with one, by their edges, of those that are set.
Cells part_of(const Cells& cells, int column, int row) {
  Cells part{};
  std::vector<std::array<int, 2>> next = {{column, row}};
  while (!next.empty()) {
    const auto [c, r] = next.back();
    next.pop_back();
    if (!holds(cells, c, r) || holds(part, c, r)) continue;
    part[static_cast<std::size_t>(r * kCells + c)] = 1;
    for (const auto& [dc, dr] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) next.push_back({c + dc, r + dr});
  }
  return part;
}

Cells largest_part(const Cells& cells) {
  Cells best{};
  std::ptrdiff_t most = 0;
  for (int i = 0; i < kCells * kCells; ++i) {
    if (!holds(cells, i % kCells, i / kCells)) continue;
    const Cells part = part_of(cells, i % kCells, i / kCells);
    const auto size = std::count(part.begin(), part.end(), 1);
    if (size > most) {
      most = size;
      best = part;
    }
  }
  return best;
}

/// Whatever cannot be reached from the border without crossing the part.
Cells filled(const Cells& part) {
  Cells empty{};
  for (std::size_t i = 0; i < part.size(); ++i) empty[i] = part[i] == 0 ? 1 : 0;
  Cells outside{};
  for (int i = 0; i < kCells * kCells; ++i) {
    if (!is_border(i % kCells, i / kCells) || !holds(empty, i % kCells, i / kCells)) continue;
    const Cells reached = part_of(empty, i % kCells, i / kCells);
    for (std::size_t k = 0; k < reached.size(); ++k) outside[k] = static_cast<char>(outside[k] | reached[k]);
  }
  for (char& cell : outside) cell = cell == 0 ? 1 : 0;
  return outside;
}

}  // namespace

std::vector<Eigen::Vector2d> CalibratedArea::outline_px() const {
  Cells cells{};
  for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = counts_[i] > 0 ? 1 : 0;
  cells = filled(largest_part(cells));
  const auto first = std::find(cells.begin(), cells.end(), 1);
  if (first == cells.end()) return {};
  // Along the border with the cells to the right, from the upper left corner of the first; directions: right, down, left, up.
  constexpr std::array<std::array<int, 2>, 4> kSteps = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  // The cell to the right of a step that leaves the corner (column, row), and the one to its left.
  constexpr std::array<std::array<int, 2>, 4> kRight = {{{0, 0}, {-1, 0}, {-1, -1}, {0, -1}}};
  constexpr std::array<std::array<int, 2>, 4> kLeft = {{{0, -1}, {0, 0}, {-1, 0}, {-1, -1}}};
  const int start = static_cast<int>(first - cells.begin());
  int column = start % kCells;
  int row = start / kCells;
  const std::array<int, 2> from = {column, row};
  std::size_t direction = 0;
  std::vector<Eigen::Vector2d> outline;
  do {
    outline.emplace_back(edge_px(column, width_px_), edge_px(row, height_px_));
    do {
      column += kSteps[direction][0];
      row += kSteps[direction][1];
    } while (holds(cells, column + kRight[direction][0], row + kRight[direction][1]) &&
             !holds(cells, column + kLeft[direction][0], row + kLeft[direction][1]));
    // To the right where the cells end; else to the left. Cells that touch at a corner only are not joined.
    const bool ends = !holds(cells, column + kRight[direction][0], row + kRight[direction][1]);
    direction = (direction + (ends ? 1 : 3)) % 4;
  } while (column != from[0] || row != from[1] || direction != 0);
  return outline;
}

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
