#include "scan/detail/guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "math/median.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kSampleEvery = 5;
constexpr float kJumpSlopes = 4.0F;
constexpr float kJumpSigmas = 6.0F;
constexpr float kCreaseSlopes = 0.1F;
constexpr float kCreaseSigmas = 5.0F;
constexpr float kFading = 2.0F;  // times the largest sigma that is taken: light that fades, no end of a surface

/// Marks what lies within `reach` of a marked pixel of the row.
void spread_along(const char* bad, std::size_t count, int reach, char* out) {
  std::copy_n(bad, count, out);
  for (std::size_t k = 1; k <= std::min(static_cast<std::size_t>(reach), count - 1); ++k) {
    for (std::size_t i = 0; i + k < count; ++i) out[i] |= bad[i + k];
    for (std::size_t i = k; i < count; ++i) out[i] |= bad[i - k];
  }
}

float largest_sigma(const base::PhaseMap& map, std::size_t pixel) {
  return std::max(map.x ? map.x->sigma_turns[pixel] : 0.0F, map.y ? map.y->sigma_turns[pixel] : 0.0F);
}

/// Where a plane's values jump from each of a row of pixels to its neighbour `step` pixels on; never where one has none.
void mark_jumps(const base::PhasePlane& plane, std::size_t first, std::size_t count, std::ptrdiff_t step, float limit,
                char* bad) {
  const float* t = &plane.turns[first];
  const float* sigma = &plane.sigma_turns[first];
  for (std::size_t i = 0; i < count; ++i) {
    const auto other = static_cast<std::ptrdiff_t>(i) + step;
    const float noise = kJumpSigmas * std::max(sigma[i], sigma[other]);
    bad[i] |= static_cast<char>(std::abs(t[i] - t[other]) > limit + noise);
  }
}

/// Where the slope over the three pixels before differs from that over the three after, `step` apart; never where one has none.
void mark_creases(const base::PhasePlane& plane, std::size_t first, std::size_t count, std::ptrdiff_t step, float limit,
                  char* bad) {
  const float* t = &plane.turns[first];
  const float* sigma = &plane.sigma_turns[first];
  for (std::size_t k = 0; k < count; ++k) {
    const auto i = static_cast<std::ptrdiff_t>(k);
    const float change =
        0.5F * (t[i + 3 * step] - t[i + step] - t[i - step] + t[i - 3 * step]);  // its sigma is that of a pixel
    const float noise = kCreaseSigmas * std::max(std::max(sigma[i - step], sigma[i]), sigma[i + step]);
    const int there = t[i] == t[i];  // a number
    bad[k] |= static_cast<char>(static_cast<int>(std::abs(change) > limit + noise) & there);
  }
}

/// Both of a plane's, along rows and columns, in one row of the image.
void mark_row(const base::PhasePlane& plane, int width, int height, int y, float slope, bool creases, char* bad) {
  constexpr int kReach = 3;  // of a crease
  const auto w = static_cast<std::size_t>(width);
  const auto down = static_cast<std::ptrdiff_t>(w);
  const std::size_t at = static_cast<std::size_t>(y) * w;
  const float jump = kJumpSlopes * slope;
  mark_jumps(plane, at, w - 1, 1, jump, bad);
  mark_jumps(plane, at + 1, w - 1, -1, jump, bad + 1);
  if (y + 1 < height) mark_jumps(plane, at, w, down, jump, bad);
  if (y > 0) mark_jumps(plane, at, w, -down, jump, bad);
  if (!creases) return;
  const float bend = kCreaseSlopes * slope;
  if (width > 2 * kReach) mark_creases(plane, at + kReach, w - 2 * kReach, 1, bend, bad + kReach);
  if (y >= kReach && y + kReach < height) mark_creases(plane, at, w, down, bend, bad);
}

}  // namespace

double median_slope(const base::PhasePlane& plane, int width, int height) {
  std::vector<float> across, down;
  for (int y = 0; y + 1 < height; y += kSampleEvery) {
    for (int x = 0; x + 1 < width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const float right = std::abs(plane.turns[at + 1] - plane.turns[at]);
      const float below = std::abs(plane.turns[at + static_cast<std::size_t>(width)] - plane.turns[at]);
      if (!std::isnan(right)) across.push_back(right);
      if (!std::isnan(below)) down.push_back(below);
    }
  }
  return std::max(math::median(across), math::median(down));
}

std::vector<char> guarded_pixels(const base::PhaseMap& map, int guard_px, bool creases, int threads) {
  const auto w = static_cast<std::size_t>(map.width);
  std::vector<float> of_bands(band_count(map.height), 0.0F);
  over_rows(map.height, threads, [&](int first, int last) {
    float largest = 0.0F;
    for (std::size_t i = static_cast<std::size_t>(first) * w; i < static_cast<std::size_t>(last) * w; ++i) {
      if (map.status[i] == base::PhaseStatus::kValid) largest = std::max(largest, largest_sigma(map, i));
    }
    of_bands[band_of(first)] = largest;
  });
  const float fading = kFading * *std::max_element(of_bands.begin(), of_bands.end());
  std::array<float, 2> slopes = {};
  const std::array<const base::PhasePlane*, 2> planes = {map.x ? &*map.x : nullptr, map.y ? &*map.y : nullptr};
  for (std::size_t p = 0; p < 2; ++p) {
    if (planes[p] != nullptr) slopes[p] = static_cast<float>(median_slope(*planes[p], map.width, map.height));
  }
  std::vector<char> along(map.status.size());
  over_rows(map.height, threads, [&](int first, int last) {
    std::vector<char> bad(w);
    for (int y = first; y < last; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * w;
      for (std::size_t x = 0; x < w; ++x) {
        const base::PhaseStatus status = map.status[at + x];
        bad[x] =
            status != base::PhaseStatus::kValid && !(status == base::PhaseStatus::kDark && largest_sigma(map, at + x) < fading);
      }
      for (std::size_t p = 0; p < 2; ++p) {
        if (planes[p] != nullptr) mark_row(*planes[p], map.width, map.height, y, slopes[p], creases, bad.data());
      }
      spread_along(bad.data(), w, guard_px, &along[at]);
    }
  });
  std::vector<char> all(map.status.size());
  over_rows(map.height, threads, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      char* row = &all[static_cast<std::size_t>(y) * w];
      for (int other = std::max(0, y - guard_px); other <= std::min(map.height - 1, y + guard_px); ++other) {
        const char* bad = &along[static_cast<std::size_t>(other) * w];
        for (std::size_t x = 0; x < w; ++x) row[x] |= bad[x];
      }
      const base::PhaseStatus* status = &map.status[static_cast<std::size_t>(y) * w];
      for (std::size_t x = 0; x < w; ++x) row[x] = !row[x] && status[x] == base::PhaseStatus::kValid;
    }
  });
  return all;
}

}  // namespace crosstie::scan::detail
