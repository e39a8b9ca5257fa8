#include "markers/detail/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include <Eigen/LU>

#include "markers/detail/blobs.h"
#include "markers/detail/level_kernels.h"

namespace crosstie::markers::detail {
namespace {

/// In reduced images: smallest semi-minor axis [px of the level], what is smaller was found in the level below.
constexpr double kMinReducedRadiusPx = 3.5;
/// Largest semi-minor axis that is looked for where a coarser level follows; such dots fill the window of the mean.
constexpr double kMaxLevelRadiusPx = 18.0;
constexpr int kSmallestSidePx = 32;
constexpr int kLeastMergedRange = 24;  ///< grey levels between dot and ground: fainter ones are not parted from their rings

/// The samples in 8 bits: they themselves where they are.
GreyPlane eight_bit(const base::ImageView& image, std::vector<std::uint8_t>& samples) {
  if (image.bits == 8) {
    return {reinterpret_cast<const std::uint8_t*>(image.data), image.width, image.height, image.row_stride_bytes};
  }
  samples.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  const float scale = 255.0F / static_cast<float>(image.white_level);
  std::uint8_t* to = samples.data();
  for (int y = 0; y < image.height; ++y) {
    const std::uint16_t* row = image.row<std::uint16_t>(y);
    for (int x = 0; x < image.width; ++x) {
      *to++ = static_cast<std::uint8_t>(std::min(scale * static_cast<float>(row[x]) + 0.5F, 255.0F));
    }
  }
  return {samples.data(), image.width, image.height, image.width};
}

/// Standard deviation of the noise in grey levels: from the median of second differences along sampled rows.
double noise_level(const GreyPlane& grey) {
  constexpr int kSampledRows = 128;
  std::array<std::int64_t, 1024> counts{};
  std::int64_t n = 0;
  for (int y = 0; y < grey.height; y += 1 + grey.height / kSampledRows) {
    const std::uint8_t* row = grey.row(y);
    for (int x = 1; x + 1 < grey.width; x += 3) {
      ++counts[static_cast<std::size_t>(std::abs(row[x - 1] - 2 * row[x] + row[x + 1]))];
      ++n;
    }
  }
  std::int64_t below = 0;
  std::size_t median = 0;
  while (median + 1 < counts.size() && 2 * (below += counts[median]) < n) ++median;
  return 1.4826 * static_cast<double>(median) / std::sqrt(6.0);
}

/// The ellipse with the region's moments; nothing where the region is not filled like one.
std::optional<Ellipse> ellipse_of(const Blob& blob) {
  const auto n = static_cast<double>(blob.count);
  const double mean_x = static_cast<double>(blob.x) / n;
  const double mean_y = static_cast<double>(blob.y) / n;
  constexpr double kPixel = 1.0 / 12.0;  // second moment of a pixel itself
  Eigen::Matrix2d moments;
  moments(0, 0) = static_cast<double>(blob.xx) / n - mean_x * mean_x + kPixel;
  moments(1, 1) = static_cast<double>(blob.yy) / n - mean_y * mean_y + kPixel;
  moments(0, 1) = moments(1, 0) = static_cast<double>(blob.xy) / n - mean_x * mean_y;
  // An ellipse has the smallest moments that its area allows.
  const double area = 4.0 * std::numbers::pi * std::sqrt(std::max(moments.determinant(), 0.0));
  constexpr double kFilled = 0.88;
  if (n < kFilled * area - 2.0) return std::nullopt;
  const auto ellipse = Ellipse::from_moments({mean_x, mean_y}, moments);
  if (!ellipse) return std::nullopt;
  const Eigen::Vector2d excess =
      0.5 * Eigen::Vector2d(blob.right - blob.left + 1, blob.bottom - blob.top + 1) - ellipse->half_extent_px();
  if (excess.cwiseAbs().maxCoeff() > 1.2 + 0.15 * ellipse->semi_minor_px) return std::nullopt;
  return ellipse;
}

struct Limits {
  double min_minor_px, max_minor_px, max_major_px, min_axis_ratio;
};

/// Where the blur fills the gap, dot and ring make one region, or a dot one that is too large. Halfway between the darkest and the
/// brightest pixel around it they are apart. Nothing where the region is not blurred that much, or too large for it.
std::vector<Blob> apart_at_half_level(const Blob& blob, const GreyPlane& grey, bool bright, int min_range,
                                      std::int64_t min_count) {
  constexpr int kNarrowestPx = 9;
  constexpr int kLargestSidePx = 64;  // with a pixel around it
  constexpr double kSteepest = 0.5;   // of the range of levels: what neighbouring pixels of a blurred edge may differ by
  const int left = blob.left - 1;
  const int top = blob.top - 1;
  const int width = blob.right - left + 2;
  const int height = blob.bottom - top + 2;
  if (width > kLargestSidePx || height > kLargestSidePx || width < kNarrowestPx) return {};
  const LevelRange levels = level_range(grey.row(top) + left, grey.stride, width, height);
  const int range = levels.brightest - levels.darkest;
  if (levels.steepest > kSteepest * range || range < min_range) return {};
  const int middle = (levels.darkest + levels.brightest) / 2;
  std::array<std::uint64_t, kLargestSidePx> words{};
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* const row = grey.row(top + y) + left;
    std::uint64_t word = 0;
    for (int x = 0; x < width; ++x) word |= static_cast<std::uint64_t>((row[x] > middle) == bright) << x;
    words[static_cast<std::size_t>(y)] = word;
  }
  std::vector<Blob> parts = find_blobs(words.data(), width, height, min_count);
  for (Blob& part : parts) {
    const std::int64_t n = part.count;
    part.xx += 2 * left * part.x + n * left * left;
    part.yy += 2 * top * part.y + n * top * top;
    part.xy += left * part.y + top * part.x + n * left * top;
    part.x += n * left;
    part.y += n * top;
    part.left += left;
    part.right += left;
    part.top += top;
    part.bottom += top;
  }
  return parts;
}

void add_candidates(const std::vector<std::uint64_t>& words, const GreyPlane& grey, bool bright, int level, int min_range,
                    const Limits& limits, std::vector<Candidate>& candidates) {
  const double min_area = std::numbers::pi * limits.min_minor_px * limits.min_minor_px;
  const double scale = std::exp2(level);
  constexpr std::int64_t kLeastMerged = 40;  // pixels of a dot and a ring that can be read
  constexpr double kSmaller = 0.9;           // than the whole region, if it is to be another candidate
  const auto add = [&](const Blob& blob, double max_minor_px) {
    auto ellipse = ellipse_of(blob);
    if (!ellipse || ellipse->semi_minor_px < limits.min_minor_px || ellipse->semi_minor_px > max_minor_px ||
        ellipse->semi_major_px > limits.max_major_px ||
        ellipse->semi_minor_px < limits.min_axis_ratio * ellipse->semi_major_px) {
      return 0.0;
    }
    const double semi_minor_px = ellipse->semi_minor_px;
    ellipse->centre_px = (scale * (ellipse->centre_px.array() + 0.5) - 0.5).matrix();
    ellipse->semi_major_px *= scale;
    ellipse->semi_minor_px *= scale;
    candidates.push_back({*ellipse, bright, scale});
    return semi_minor_px;
  };
  for (const Blob& blob : find_blobs(words.data(), grey.width, grey.height, static_cast<std::int64_t>(min_area))) {
    if (blob.left == 0 || blob.top == 0 || blob.right + 1 == grey.width || blob.bottom + 1 == grey.height) continue;
    const double semi_minor_px = add(blob, limits.max_minor_px);
    if (blob.count < kLeastMerged) continue;
    const double smaller_px = semi_minor_px > 0.0 ? kSmaller * semi_minor_px : limits.max_minor_px;
    for (const Blob& part : apart_at_half_level(blob, grey, bright, min_range, static_cast<std::int64_t>(min_area))) {
      add(part, smaller_px);
    }
  }
}

}  // namespace

std::vector<Candidate> find_candidates(const base::ImageView& image, const DetectOptions& options) {
  std::vector<std::uint8_t> samples, reduced;
  GreyPlane grey = eight_bit(image, samples);
  const double noise = noise_level(grey);
  const double max_radius_px = options.max_radius_px > 0.0 ? options.max_radius_px : 0.25 * std::min(image.width, image.height);
  std::vector<Candidate> candidates;
  std::vector<std::uint64_t> brighter, darker;
  for (int level = 0;; ++level) {
    const double scale = std::exp2(level);
    const bool last = std::min(grey.width, grey.height) < 2 * kSmallestSidePx || max_radius_px < 8.0 * scale;
    const Limits limits{level == 0 ? options.min_radius_px - 0.25 : kMinReducedRadiusPx, last ? 1e9 : kMaxLevelRadiusPx,
                        max_radius_px / scale + 1.0, 0.85 * options.min_axis_ratio};
    const int delta = static_cast<int>(std::lround(std::clamp(3.0 * noise / scale, 2.0, 12.0)));
    const int min_range = std::max(4 * delta, kLeastMergedRange);
    const std::size_t words = words_per_row(grey.width) * static_cast<std::size_t>(grey.height);
    brighter.resize(words);
    darker.resize(words);
    compare_with_local_mean(grey, delta, brighter.data(), darker.data());
    if (options.polarity != Polarity::kDarkDots) add_candidates(brighter, grey, true, level, min_range, limits, candidates);
    if (options.polarity != Polarity::kBrightDots) add_candidates(darker, grey, false, level, min_range, limits, candidates);
    if (last) break;
    const int width = grey.width / 2;
    const int height = grey.height / 2;
    reduced.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    halve(grey, reduced.data());
    samples.swap(reduced);
    grey = {samples.data(), width, height, width};
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.ellipse.semi_major_px * a.ellipse.semi_minor_px > b.ellipse.semi_major_px * b.ellipse.semi_minor_px;
  });
  return candidates;
}

}  // namespace crosstie::markers::detail
