#include "markers/detail/dot_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

namespace crosstie::markers::detail {
namespace {

constexpr double kOutlier = 4.0;       // standard deviations from which on a pixel loses weight
constexpr double kQuantisation = 0.3;  // grey levels: no pixel is better than the rounding of its level
constexpr double kMadToSigma = 1.4826;

constexpr std::size_t kBins = 128;
constexpr int kEnough = 8;

/// Counts of residuals in bins of equal width; what is larger than all falls into the last one.
using Histogram = std::array<int, kBins>;

/// In bins, interpolated within its bin; nothing of too few.
std::optional<double> median_of(const Histogram& counts) {
  const int all = std::accumulate(counts.begin(), counts.end(), 0);
  if (all < kEnough) return std::nullopt;
  int below = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    const int here = counts[bin];
    if (2 * (below + here) >= all) return static_cast<double>(bin) + (0.5 * all - below) / std::max(here, 1);
    below += here;
  }
  return kBins;
}

}  // namespace

DotNoise noise_of(const PixelSet& pixels, double saturated_level) {
  // In lanes, so that compilers can use vectors.
  constexpr std::size_t kLanes = 8;
  std::array<float, kLanes> steepest_of{}, sums{};
  std::size_t pixel = 0;
  for (; pixel + kLanes <= pixels.used; pixel += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float slope = std::abs(pixels.slope[pixel + lane]);
      steepest_of[lane] = slope > steepest_of[lane] ? slope : steepest_of[lane];
      sums[lane] += std::abs(pixels.residual[pixel + lane]);
    }
  }
  for (; pixel < pixels.used; ++pixel) {
    steepest_of[0] = std::max(steepest_of[0], std::abs(pixels.slope[pixel]));
    sums[0] += std::abs(pixels.residual[pixel]);
  }
  const float steepest = *std::max_element(steepest_of.begin(), steepest_of.end());
  const float sum = std::accumulate(sums.begin(), sums.end(), 0.0F);
  // The medians of the parts lie below some times the mean of all.
  constexpr float kRange = 4.0F;
  const float width = std::max(kRange * sum / static_cast<float>(pixels.used) / kBins, 1e-6F);
  const float per_width = 1.0F / width;
  const auto saturated = static_cast<float>(saturated_level);
  constexpr float kLast = kBins - 1;
  std::array<Histogram, 2> sides{};  // outside and inside
  Histogram edge{};
  for (std::size_t i = 0; i < pixels.used; ++i) {
    // Where the image is cut off, the residual says nothing of the noise.
    if (pixels.grey[i] >= saturated) continue;
    const auto bin = static_cast<std::size_t>(std::min(std::abs(pixels.residual[i]) * per_width, kLast));
    ++sides[pixels.inside[i] < 0.5F ? 0 : 1][bin];
    edge[bin] += std::abs(pixels.slope[i]) > 0.4F * steepest ? 1 : 0;
  }
  // Residuals of an adjustment are smaller than the noise by what its parameters took up.
  const double redundancy =
      1.0 - static_cast<double>(kDotColumns) / static_cast<double>(std::max<std::size_t>(pixels.used, 24));
  const double per_bin = kMadToSigma * static_cast<double>(width) / std::sqrt(redundancy);
  DotNoise noise;
  noise.steepest = std::max(static_cast<double>(steepest), 1e-6);
  if (const auto median = median_of(sides[0])) noise.outer = std::max(kQuantisation, per_bin * *median);
  noise.inner = noise.outer;
  if (const auto median = median_of(sides[1])) noise.inner = std::max(kQuantisation, per_bin * *median);
  if (const auto median = median_of(edge)) noise.edge = per_bin * *median;
  return noise;
}

void weigh(const DotNoise& noise, PixelSet& pixels) {
  const auto outer2 = static_cast<float>(noise.outer * noise.outer);
  const auto more = static_cast<float>(noise.inner * noise.inner) - outer2;
  const auto per_slope2 = static_cast<float>(std::pow(noise.edge / noise.steepest, 2));
  constexpr auto kLimit = static_cast<float>(kOutlier * kOutlier);
  const std::size_t count = pixels.x.size();
  for (std::size_t i = 0; i < count; ++i) {
    const float variance = outer2 + more * pixels.inside[i];
    pixels.weight[i] = 1.0F / variance;
    pixels.limit2[i] = kLimit * (variance + per_slope2 * pixels.slope[i] * pixels.slope[i]);
  }
  for (std::size_t i = pixels.used; i < count; ++i) pixels.weight[i] = 0.0F;
}

void weigh_equally(double sigma, PixelSet& pixels) {
  const auto variance = static_cast<float>(sigma * sigma);
  const auto used = static_cast<std::ptrdiff_t>(pixels.used);
  std::fill(pixels.weight.begin(), pixels.weight.begin() + used, 1.0F / variance);
  std::fill(pixels.weight.begin() + used, pixels.weight.end(), 0.0F);
  std::fill(pixels.limit2.begin(), pixels.limit2.end(), static_cast<float>(kOutlier * kOutlier) * variance);
}

}  // namespace crosstie::markers::detail
