#include "scan/detail/smooth.h"

#include <cstddef>

#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

/// Sums over a window of rows for all columns, and how many of the summed pixels are good.
struct ColumnSums {
  std::vector<double> sums;
  std::vector<int> counts;
};

}  // namespace

std::vector<float> box_mean(std::span<const float> plane, const std::vector<char>& good, int width, int height, int radius,
                            int threads, std::vector<char>* averaged) {
  std::vector<float> result(plane.begin(), plane.end());
  if (averaged != nullptr) averaged->assign(plane.size(), 0);
  if (radius < 1) return result;
  const auto w = static_cast<std::size_t>(width);
  const int full = (2 * radius + 1) * (2 * radius + 1);
  over_rows(height, threads, [&](int first, int last) {
    ColumnSums columns{std::vector<double>(w, 0.0), std::vector<int>(w, 0)};
    const auto add = [&](int y, int sign) {
      if (y < 0 || y >= height) return;
      const std::size_t at = static_cast<std::size_t>(y) * w;
      for (std::size_t x = 0; x < w; ++x) {
        if (!good[at + x]) continue;
        columns.sums[x] += sign * static_cast<double>(plane[at + x]);
        columns.counts[x] += sign;
      }
    };
    for (int y = first - radius; y < first + radius; ++y) add(y, 1);
    for (int y = first; y < last; ++y) {
      add(y + radius, 1);
      double sum = 0.0;
      int count = 0;
      const auto take = [&](int x, int sign) {
        if (x < 0 || x >= width) return;
        sum += sign * columns.sums[static_cast<std::size_t>(x)];
        count += sign * columns.counts[static_cast<std::size_t>(x)];
      };
      for (int x = -radius; x < radius; ++x) take(x, 1);
      for (int x = 0; x < width; ++x) {
        take(x + radius, 1);
        if (count == full) {
          const std::size_t at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
          result[at] = static_cast<float>(sum / full);
          if (averaged != nullptr) (*averaged)[at] = 1;
        }
        take(x - radius, -1);
      }
      add(y - radius, -1);
    }
  });
  return result;
}

}  // namespace crosstie::scan::detail
