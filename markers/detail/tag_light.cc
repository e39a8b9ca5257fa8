#include "markers/detail/tag_light.h"

#include <array>

#include "math/edge_profile.h"

namespace crosstie::markers::detail {
namespace {

constexpr std::size_t kMostCells = 16;

/// Share of each cell along one axis.
std::array<double, kMostCells> shares(int cells, double at, double blur_cells) {
  std::array<double, kMostCells> share{};
  double before = 0.0;
  for (int i = 0; i < cells; ++i) {
    const double after = i + 1 == cells ? 1.0 : math::edge_profile((i + 1 - at) / blur_cells).distribution;
    share[static_cast<std::size_t>(i)] = after - before;
    before = after;
  }
  return share;
}

}  // namespace

double blurred_tone(const TagPattern& pattern, const TagFrame& frame, double blur_px, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d at = frame.cell(pixel);
  const Eigen::Matrix2d j = frame.cell_by_pixel(pixel);
  const int cells = pattern.layout.total_cells;
  const auto across = shares(cells, at.x(), blur_px * j.row(0).norm());
  const auto down = shares(cells, at.y(), blur_px * j.row(1).norm());
  double tone = 0.0;
  for (int y = 0; y < cells; ++y) {
    const double share_y = down[static_cast<std::size_t>(y)];
    if (share_y < 1e-6) continue;
    for (int x = 0; x < cells; ++x) {
      const double share = share_y * across[static_cast<std::size_t>(x)];
      if (share > 1e-6) tone += share * pattern.tone(x, y);
    }
  }
  return tone;
}

}  // namespace crosstie::markers::detail
