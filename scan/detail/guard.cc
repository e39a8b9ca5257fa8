#include "scan/detail/guard.h"

#include <algorithm>
#include <cmath>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kSampleEvery = 5;
constexpr float kJumpSlopes = 4.0F;
constexpr float kJumpSigmas = 6.0F;
constexpr float kCreaseSlopes = 0.1F;
constexpr float kCreaseSigmas = 5.0F;
constexpr float kFading = 2.0F;  // times the largest sigma that is taken: light that fades, no end of a surface

/// Marks what lies within `reach` of a marked entry of a line.
void spread(const char* bad, std::size_t count, std::size_t stride, int reach, char* out) {
  int left = 0;
  for (std::size_t i = 0; i < count; ++i) {
    left = bad[i * stride] ? reach + 1 : std::max(0, left - 1);
    if (left > 0) out[i * stride] = 1;
  }
  left = 0;
  for (std::size_t i = count; i-- > 0;) {
    left = bad[i * stride] ? reach + 1 : std::max(0, left - 1);
    if (left > 0) out[i * stride] = 1;
  }
}

float largest_sigma(const base::PhaseMap& map, std::size_t pixel) {
  return std::max(map.x ? map.x->sigma_turns[pixel] : 0.0F, map.y ? map.y->sigma_turns[pixel] : 0.0F);
}

void mark_jumps(const base::PhasePlane& plane, int width, int height, std::vector<char>& bad) {
  const auto limit = kJumpSlopes * static_cast<float>(median_slope(plane, width, height));
  const auto mark = [&](std::size_t a, std::size_t b) {
    const float noise = kJumpSigmas * std::max(plane.sigma_turns[a], plane.sigma_turns[b]);
    if (std::abs(plane.turns[a] - plane.turns[b]) > limit + noise) bad[a] = bad[b] = 1;  // never true where there is none
  };
  const auto w = static_cast<std::size_t>(width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(height); ++y) {
    for (std::size_t x = 0; x < w; ++x) {
      if (x + 1 < w) mark(y * w + x, y * w + x + 1);
      if (y + 1 < static_cast<std::size_t>(height)) mark(y * w + x, (y + 1) * w + x);
    }
  }
}

/// Where the slope over the three pixels before differs from that over the three after.
void mark_creases(const base::PhasePlane& plane, int width, int height, std::vector<char>& bad) {
  constexpr int kReach = 3;
  const auto limit = kCreaseSlopes * static_cast<float>(median_slope(plane, width, height));
  const auto mark = [&](std::size_t at, std::size_t stride) {
    const float* t = &plane.turns[at];
    const auto s = static_cast<std::ptrdiff_t>(stride);
    const float change = 0.5F * (t[3 * s] - t[s] - t[-s] + t[-3 * s]);  // its sigma is that of a pixel
    const float noise = std::max({plane.sigma_turns[at - stride], plane.sigma_turns[at], plane.sigma_turns[at + stride]});
    if (std::abs(change) > limit + kCreaseSigmas * noise) bad[at] = 1;  // never true where there is none
  };
  const auto w = static_cast<std::size_t>(width);
  for (int y = 0; y < height; ++y) {
    const bool down = y >= kReach && y + kReach < height;
    for (int x = 0; x < width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
      if (std::isnan(plane.turns[at])) continue;
      if (x >= kReach && x + kReach < width) mark(at, 1);
      if (down) mark(at, w);
    }
  }
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

std::vector<char> guarded_pixels(const base::PhaseMap& map, int guard_px, bool creases) {
  std::vector<char> bad(map.status.size());
  float fading = 0.0F;
  for (std::size_t i = 0; i < bad.size(); ++i) {
    bad[i] = map.status[i] != base::PhaseStatus::kValid;
    if (!bad[i]) fading = std::max(fading, kFading * largest_sigma(map, i));
  }
  for (std::size_t i = 0; i < bad.size(); ++i) {
    if (map.status[i] == base::PhaseStatus::kDark && largest_sigma(map, i) < fading) bad[i] = 0;
  }
  for (const auto* plane : {&map.x, &map.y}) {
    if (!*plane) continue;
    mark_jumps(**plane, map.width, map.height, bad);
    if (creases) mark_creases(**plane, map.width, map.height, bad);
  }
  std::vector<char> along = bad;
  const auto w = static_cast<std::size_t>(map.width);
  const auto h = static_cast<std::size_t>(map.height);
  for (std::size_t y = 0; y < h; ++y) spread(&bad[y * w], w, 1, guard_px, &along[y * w]);
  std::vector<char> all = along;
  for (std::size_t x = 0; x < w; ++x) spread(&along[x], h, w, guard_px, &all[x]);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = !all[i] && map.status[i] == base::PhaseStatus::kValid;
  return all;
}

}  // namespace crosstie::scan::detail
