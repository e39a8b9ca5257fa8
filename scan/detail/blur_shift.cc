#include "scan/detail/blur_shift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "scan/detail/guard.h"
#include "scan/detail/rows.h"
#include "scan/detail/smooth.h"
#include "scan/detail/surface_kernel.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kReach = kLeaningReach;
constexpr int kRadius = 3;                 // of the neighbourhood whose mean is taken off
constexpr int kGuard_px = 4;               // from the end of a surface, beyond which another one may shine in
constexpr double kTold = 5.0;              // sigmas
constexpr float kSeen = 2.0F;              // sigmas of a phase: smaller leanings may be noise of the brightness
constexpr double kOutlier = 8.0;           // sigmas of a phase: no smooth surface there
constexpr float kLeastModulation = 0.05F;  // grey levels: below, its logarithm means nothing

/// A derivative of band-limited samples over 7 of them (sixth order).
float derivative(const float* at, std::ptrdiff_t stride) {
  return 0.75F * (at[stride] - at[-stride]) - 0.15F * (at[2 * stride] - at[-2 * stride]) +
         (at[3 * stride] - at[-3 * stride]) / 60.0F;
}

/// Change of values per px from those neighbours of the same surface that there are: on both sides, else on one.
bool slope_of_some(const float* at, std::ptrdiff_t stride, float& result) {
  float sum = 0.0F, weight = 0.0F;
  for (std::ptrdiff_t k = 1; k <= kReach; ++k) {
    const float both = at[k * stride] - at[-k * stride];
    if (std::isnan(both)) continue;
    sum += static_cast<float>(k) * both;
    weight += static_cast<float>(2 * k * k);
  }
  if (weight > 0.0F) {
    result = sum / weight;
    return true;
  }
  for (const std::ptrdiff_t side : {1, -1}) {
    const float change = at[2 * side * stride] - at[side * stride];
    if (std::isnan(change)) continue;
    result = static_cast<float>(side) * change;
    return true;
  }
  return false;
}

/// grad(turns) . grad(ln B) of every valid pixel; not a number where it is not known.
base::Plane<float> leanings(const base::PhaseMap& map, const base::PhasePlane& plane, int threads) {
  constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
  const auto down = static_cast<std::ptrdiff_t>(map.width);
  base::Plane<float> result(plane.turns.size());
  over_rows(map.height, threads, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      const float* turns = &plane.turns[map.at(0, y)];
      const float* b = &plane.modulation[map.at(0, y)];
      float* lean = &result[map.at(0, y)];
      if (y < kReach || y >= map.height - kReach) {
        std::fill_n(lean, map.width, kNowhere);
        continue;
      }
      std::fill_n(lean, kReach, kNowhere);
      std::fill_n(lean + map.width - kReach, kReach, kNowhere);
      if (!lean_row(turns, b, static_cast<std::size_t>(map.width), kLeastModulation, lean)) continue;
      for (int x = kReach; x < map.width - kReach; ++x) {
        if (!std::isnan(lean[x]) || std::isnan(turns[x]) || b[x] < kLeastModulation) continue;
        float by_x = 0.0F, by_y = 0.0F;
        if (!slope_of_some(turns + x, 1, by_x) || !slope_of_some(turns + x, down, by_y)) continue;
        lean[x] = (by_x * derivative(b + x, 1) + by_y * derivative(b + x, down)) / b[x];
      }
    }
  });
  return result;
}

/// Sums of the regression of phases on leanings, both less their means over the neighbourhood (of the phase: less its plane, since its
/// mean over a square is that of the middle).
struct Sums {
  double xx = 0.0, xy = 0.0;

  void operator+=(const Sums& other) {
    xx += other.xx;
    xy += other.xy;
  }
};

Sums regress_rows(const base::PhaseMap& map, const base::PhasePlane& plane, const base::Plane<float>& lean,
                  const std::vector<char>& one_surface, int first, int last) {
  Sums sums;
  const int full = (2 * kRadius + 1) * (2 * kRadius + 1);
  std::vector<std::uint32_t> places(static_cast<std::size_t>(map.width));
  for (int y = std::max(kRadius, first); y < std::min(map.height - kRadius, last); ++y) {
    const std::size_t start = map.at(kRadius, y);
    const std::size_t found = leaning_places(&lean[start], &plane.sigma_turns[start], &one_surface[start], kSeen,
                                             static_cast<std::size_t>(map.width - 2 * kRadius), places.data());
    for (std::size_t place = 0; place < found; ++place) {
      const int x = kRadius + static_cast<int>(places[place]);
      const std::size_t at = map.at(x, y);
      const double sigma = plane.sigma_turns[at];
      double mean_lean = 0.0, mean_turns = 0.0;
      int count = 0;
      for (int dy = -kRadius; dy <= kRadius; ++dy) {
        const std::size_t row = map.at(x - kRadius, y + dy);
        for (std::size_t i = row; i <= row + 2 * static_cast<std::size_t>(kRadius); ++i) {
          if (std::isnan(lean[i])) continue;
          mean_lean += static_cast<double>(lean[i]);
          mean_turns += static_cast<double>(plane.turns[i] - plane.turns[at]);
          ++count;
        }
      }
      if (count < full) continue;
      const double a = static_cast<double>(lean[at]) - mean_lean / full;
      const double b = -mean_turns / full;
      if (std::abs(b) > kOutlier * sigma + std::abs(a)) continue;
      sums.xx += a * a / (sigma * sigma);
      sums.xy += a * b / (sigma * sigma);
    }
  }
  return sums;
}

/// laplace(turns) where one surface reaches far enough for it, from means over squares: their noise is a few hundredths of a pixel's. 0
/// elsewhere.
base::Plane<float> bendings(const base::PhasePlane& plane, const std::vector<char>& one_surface, int width, int height,
                            int threads) {
  constexpr int kMeanRadius = 3;
  constexpr int kArm = 4;  // from a square's middle to the next one's
  std::vector<char> averaged;
  const std::vector<float> mean = box_mean(plane.turns, one_surface, width, height, kMeanRadius, threads, &averaged);
  base::Plane<float> result(plane.turns.size(), 0.0F);
  const auto w = static_cast<std::size_t>(width);
  over_rows(height, threads, [&](int first, int last) {
    for (int y = std::max(kArm, first); y < std::min(height - kArm, last); ++y) {
      for (int x = kArm; x < width - kArm; ++x) {
        const std::size_t at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
        const std::size_t left = at - kArm, right = at + kArm, above = at - kArm * w, below = at + kArm * w;
        if (!averaged[at] || !averaged[left] || !averaged[right] || !averaged[above] || !averaged[below]) continue;
        result[at] = (mean[left] + mean[right] + mean[above] + mean[below] - 4.0F * mean[at]) / (kArm * kArm);
      }
    }
  });
  return result;
}

}  // namespace

BlurShift correct_blur_shift(base::PhaseMap& map, int threads) {
  BlurShift shift;
  if (map.width <= 2 * kRadius || map.height <= 2 * kRadius) return shift;
  std::array<base::Plane<float>, 2> lean;
  Sums sums;
  const std::vector<char> one_surface = guarded_pixels(map, kGuard_px, true, threads);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto& plane = i == 0 ? map.x : map.y;
    if (!plane) continue;
    lean[i] = leanings(map, *plane, threads);
    std::vector<Sums> bands(band_count(map.height));
    over_rows(map.height, threads, [&](int first, int last) {
      bands[band_of(first)] = regress_rows(map, *plane, lean[i], one_surface, first, last);
    });
    for (const Sums& band : bands) sums += band;
  }
  if (!(sums.xx > 0.0)) return shift;
  const double variance = sums.xy / sums.xx;
  const double sigma = 1.0 / std::sqrt(sums.xx);
  if (!(variance > kTold * sigma) || variance > kLargestVariance_px2) return shift;
  shift = {variance, sigma};
  for (std::size_t i = 0; i < 2; ++i) {
    auto& plane = i == 0 ? map.x : map.y;
    if (!plane) continue;
    const base::Plane<float> bend = bendings(*plane, one_surface, map.width, map.height, threads);
    over_rows(map.height, threads, [&](int first, int last) {
      for (std::size_t at = map.at(0, first); at < map.at(0, last); ++at) {
        if (!std::isnan(lean[i][at])) plane->turns[at] -= static_cast<float>(variance) * (lean[i][at] + 0.5F * bend[at]);
      }
    });
  }
  return shift;
}

}  // namespace crosstie::scan::detail
