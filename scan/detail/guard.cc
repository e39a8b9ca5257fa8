#include "scan/detail/guard.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "scan/detail/rows.h"
#include "scan/detail/surface_kernel.h"

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
  if (std::memchr(bad, 1, count) == nullptr) return;
  for (std::size_t k = 1; k <= std::min(static_cast<std::size_t>(reach), count - 1); ++k) {
    for (std::size_t i = 0; i + k < count; ++i) out[i] |= bad[i + k];
    for (std::size_t i = k; i < count; ++i) out[i] |= bad[i - k];
  }
}

/// The middle value of numbers that are not negative, of an even number the upper one of both; 0 without values. Bits of such numbers grow
/// as they do, so that counting finds it: first by their upper half, then by their lower one.
float middle_of(const std::vector<float>& values) {
  if (values.empty()) return 0.0F;
  constexpr std::uint32_t kHalf = 16;
  std::vector<std::uint32_t> counts(std::size_t{1} << kHalf, 0);
  std::size_t rank = values.size() / 2;
  const auto bin_of_rank = [&] {
    std::uint32_t bin = 0;
    while (rank >= counts[bin]) rank -= counts[bin++];
    return bin;
  };
  for (const float value : values) ++counts[std::bit_cast<std::uint32_t>(value) >> kHalf];
  const std::uint32_t upper = bin_of_rank();
  std::fill(counts.begin(), counts.end(), 0);
  for (const float value : values) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    if (bits >> kHalf == upper) ++counts[bits & ((1U << kHalf) - 1)];
  }
  return std::bit_cast<float>(upper << kHalf | bin_of_rank());
}

float largest_sigma(const base::PhaseMap& map, std::size_t pixel) {
  return std::max(map.x ? map.x->sigma_turns[pixel] : 0.0F, map.y ? map.y->sigma_turns[pixel] : 0.0F);
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
  return static_cast<double>(std::max(middle_of(across), middle_of(down)));
}

std::vector<char> guarded_pixels(const base::PhaseMap& map, int guard_px, bool creases, int threads) {
  const auto w = static_cast<std::size_t>(map.width);
  const auto* status = reinterpret_cast<const std::uint8_t*>(map.status.data());
  const std::array<const base::PhasePlane*, 2> planes = {map.x ? &*map.x : nullptr, map.y ? &*map.y : nullptr};
  std::vector<float> of_bands(band_count(map.height), 0.0F);
  over_rows(map.height, threads, [&](int first, int last) {
    const std::size_t at = map.at(0, first);
    float& largest = of_bands[band_of(first)];
    for (const base::PhasePlane* plane : planes) {
      if (plane != nullptr)
        largest = std::max(largest, largest_valid(status + at, &plane->sigma_turns[at], map.at(0, last) - at));
    }
  });
  const float fading = kFading * *std::max_element(of_bands.begin(), of_bands.end());
  std::array<SurfaceLimits, 2> limits;
  for (std::size_t p = 0; p < 2; ++p) {
    if (planes[p] == nullptr) continue;
    const auto slope = static_cast<float>(median_slope(*planes[p], map.width, map.height));
    limits[p] = {kJumpSlopes * slope, kJumpSigmas, kCreaseSlopes * slope, kCreaseSigmas, creases};
  }
  base::Plane<char> along(map.status.size());
  over_rows(map.height, threads, [&](int first, int last) {
    std::vector<char> bad(w);
    for (int y = first; y < last; ++y) {
      const std::size_t at = map.at(0, y);
      for (std::size_t x = 0; x < w; ++x) bad[x] = map.status[at + x] != base::PhaseStatus::kValid;
      if (std::memchr(bad.data(), 1, w) != nullptr) {
        for (std::size_t x = 0; x < w; ++x)
          bad[x] = bad[x] && !(map.status[at + x] == base::PhaseStatus::kDark && largest_sigma(map, at + x) < fading);
      }
      for (std::size_t p = 0; p < 2; ++p) {
        if (planes[p] == nullptr) continue;
        mark_ends(limits[p], &planes[p]->turns[at], &planes[p]->sigma_turns[at], w, y, map.height - 1 - y, bad.data());
      }
      spread_along(bad.data(), w, guard_px, &along[at]);
    }
  });
  std::vector<char> all(map.status.size());
  over_rows(map.height, threads, [&](int first, int last) {
    std::vector<const char*> rows;
    for (int y = first; y < last; ++y) {
      rows.clear();
      for (int other = std::max(0, y - guard_px); other <= std::min(map.height - 1, y + guard_px); ++other)
        rows.push_back(&along[map.at(0, other)]);
      const std::size_t at = map.at(0, y);
      char* row = &all[at];
      any_marked(rows.data(), rows.size(), w, row);
      for (std::size_t x = 0; x < w; ++x) row[x] = !row[x] && map.status[at + x] == base::PhaseStatus::kValid;
    }
  });
  return all;
}

}  // namespace crosstie::scan::detail
