#include "scan/detail/surface_end.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "scan/detail/guard.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kDensityRadius_px = 3;
constexpr double kLeastDensity = 0.25;  // of the surface about its end: less is a crumb, more a hole of single pixels
constexpr double kMostDensity = 0.85;
constexpr double kClearWay_px = 0.7;
constexpr int kArm_px = 5;  // over which a bend's slopes are taken
constexpr float kBendSigmas = 8.0F;
constexpr float kBendSlopes = 0.25F;

/// Share of marked pixels over squares; of the image's border: of what there is.
std::vector<float> density_of(const std::vector<char>& mask, int width, int height, int radius) {
  const auto w = static_cast<std::size_t>(width);
  std::vector<std::int32_t> sums((w + 1) * static_cast<std::size_t>(height + 1), 0);
  for (std::size_t y = 0; y < static_cast<std::size_t>(height); ++y) {
    std::int32_t row = 0;
    for (std::size_t x = 0; x < w; ++x) {
      row += mask[y * w + x] != 0 ? 1 : 0;
      sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
    }
  }
  std::vector<float> density(mask.size());
  for (int y = 0; y < height; ++y) {
    const auto y0 = static_cast<std::size_t>(std::max(0, y - radius));
    const auto y1 = static_cast<std::size_t>(std::min(height, y + radius + 1));
    for (int x = 0; x < width; ++x) {
      const auto x0 = static_cast<std::size_t>(std::max(0, x - radius));
      const auto x1 = static_cast<std::size_t>(std::min(width, x + radius + 1));
      const std::int32_t sum =
          sums[y1 * (w + 1) + x1] - sums[y0 * (w + 1) + x1] - sums[y1 * (w + 1) + x0] + sums[y0 * (w + 1) + x0];
      density[static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x)] =
          static_cast<float>(sum) / static_cast<float>((y1 - y0) * (x1 - x0));
    }
  }
  return density;
}

/// How much the phase's slope changes at a pixel along rows (or columns), over three lines; 0 where it cannot be told.
float bend_at(const base::PhasePlane& plane, const std::vector<char>& mask, std::ptrdiff_t at, std::ptrdiff_t along,
              std::ptrdiff_t across, float slope, float& steeper) {
  float before = 0.0F, after = 0.0F, variance = 0.0F;
  for (std::ptrdiff_t line = -1; line <= 1; ++line) {
    const std::ptrdiff_t centre = at + line * across;
    const std::array<std::size_t, 4> ends = {static_cast<std::size_t>(centre - kArm_px * along),
                                             static_cast<std::size_t>(centre - along), static_cast<std::size_t>(centre + along),
                                             static_cast<std::size_t>(centre + kArm_px * along)};
    for (const std::size_t end : ends) {
      if (!mask[end]) return 0.0F;
      variance += plane.sigma_turns[end] * plane.sigma_turns[end];
    }
    before += plane.turns[ends[1]] - plane.turns[ends[0]];
    after += plane.turns[ends[3]] - plane.turns[ends[2]];
  }
  constexpr float kScale = 1.0F / (3.0F * static_cast<float>(kArm_px - 1));
  const float change = kScale * std::abs(after - before);
  steeper = std::abs(after) - std::abs(before);
  const float limit = kBendSigmas * kScale * std::sqrt(variance) + kBendSlopes * slope;
  return change > limit ? change : 0.0F;
}

/// To the middle of the pixels of no surface nearby: also where the gap is narrow and another surface follows.
Eigen::Vector2d way_out(const std::vector<char>& mask, std::size_t width, std::size_t at) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double count = 0.0;
  for (int dy = -kDensityRadius_px; dy <= kDensityRadius_px; ++dy) {
    for (int dx = -kDensityRadius_px; dx <= kDensityRadius_px; ++dx) {
      const auto there = static_cast<std::ptrdiff_t>(at) + dy * static_cast<std::ptrdiff_t>(width) + dx;
      if (mask[static_cast<std::size_t>(there)] || dx * dx + dy * dy > kDensityRadius_px * kDensityRadius_px + 1) continue;
      sum += Eigen::Vector2d(dx, dy);
      count += 1.0;
    }
  }
  return count > 0.0 ? Eigen::Vector2d(sum / count) : sum;
}

}  // namespace

std::vector<SurfaceEnd> surface_ends(const base::PhaseMap& map, int threads) {
  const int width = map.width;
  const int height = map.height;
  const auto w = static_cast<std::size_t>(width);
  std::vector<char> mask = guarded_pixels(map, 0, false, threads);
  const std::vector<float> near = density_of(mask, width, height, 1);
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = near[i] > 0.5F;
  const std::vector<float> density = density_of(mask, width, height, kDensityRadius_px);

  std::vector<std::vector<SurfaceEnd>> rows(static_cast<std::size_t>(height));
  constexpr int kBorder = kArm_px + 2;
  std::array<float, 2> slopes = {};
  const std::array<const base::PhasePlane*, 2> planes = {map.x ? &*map.x : nullptr, map.y ? &*map.y : nullptr};
  for (std::size_t p = 0; p < 2; ++p) {
    if (planes[p] != nullptr) slopes[p] = static_cast<float>(median_slope(*planes[p], width, height));
  }
  // Bends along rows and along columns, each with its sign of the flatter side.
  std::array<std::vector<float>, 2> bends = {std::vector<float>(mask.size(), 0.0F), std::vector<float>(mask.size(), 0.0F)};
  const auto bend_row = [&](std::size_t row) -> base::Result<> {
    const auto y = static_cast<int>(row);
    if (y < kBorder || y >= height - kBorder) return {};
    for (int x = kBorder; x < width - kBorder; ++x) {
      const std::size_t at = row * w + static_cast<std::size_t>(x);
      if (!mask[at]) continue;
      for (std::size_t direction = 0; direction < 2; ++direction) {
        const auto along = static_cast<std::ptrdiff_t>(direction == 0 ? 1 : w);
        const auto across = static_cast<std::ptrdiff_t>(direction == 0 ? w : 1);
        for (std::size_t p = 0; p < 2; ++p) {
          if (planes[p] == nullptr) continue;
          float steeper = 0.0F;
          const float bend = bend_at(*planes[p], mask, static_cast<std::ptrdiff_t>(at), along, across, slopes[p], steeper) /
                             std::max(slopes[p], 1e-9F);
          if (bend > std::abs(bends[direction][at])) bends[direction][at] = steeper > 0.0F ? bend : -bend;
        }
      }
    }
    return {};
  };
  const auto end_row = [&](std::size_t row) -> base::Result<> {
    const auto y = static_cast<int>(row);
    if (y < kBorder || y >= height - kBorder) return {};
    for (int x = kBorder; x < width - kBorder; ++x) {
      const std::size_t at = row * w + static_cast<std::size_t>(x);
      if (!mask[at]) continue;
      if (!mask[at - 1] || !mask[at + 1] || !mask[at - w] || !mask[at + w]) {
        if (static_cast<double>(density[at]) < kLeastDensity || static_cast<double>(density[at]) > kMostDensity) continue;
        const Eigen::Vector2d out = way_out(mask, w, at);
        if (out.norm() > kClearWay_px) rows[row].push_back({x, y, out.normalized(), false});
        continue;
      }
      for (std::size_t direction = 0; direction < 2; ++direction) {
        const std::size_t step = direction == 0 ? 1 : w;
        const float here = std::abs(bends[direction][at]);
        if (here == 0.0F || here < std::abs(bends[1 - direction][at])) continue;
        if (here < std::abs(bends[direction][at - step]) || here <= std::abs(bends[direction][at + step])) continue;
        const double sign = bends[direction][at] > 0.0F ? 1.0 : -1.0;
        // The other direction's part tells how the bend lies.
        Eigen::Vector2d out(static_cast<double>(bends[0][at]), static_cast<double>(bends[1][at]));
        if (out(direction == 0 ? 1 : 0) == 0.0) out = direction == 0 ? Eigen::Vector2d(sign, 0.0) : Eigen::Vector2d(0.0, sign);
        rows[row].push_back({x, y, out.normalized(), true});
        break;
      }
    }
    return {};
  };
  // Neither fails.
  (void)base::parallel_for(rows.size(), threads, "bends", {}, bend_row);
  (void)base::parallel_for(rows.size(), threads, "ends", {}, end_row);
  std::vector<SurfaceEnd> all;
  for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
  return all;
}

}  // namespace crosstie::scan::detail
