#include "markers/detail/dot_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace crosstie::markers::detail {
namespace {

constexpr double kOutlier = 4.0;       // standard deviations from which on a pixel loses weight
constexpr double kQuantisation = 0.3;  // grey levels: no pixel is better than the rounding of its level
constexpr double kMadToSigma = 1.4826;

/// Counts of residuals in bins of equal width; what is larger than all falls into the last one.
class Histogram {
 public:
  void add(std::size_t bin) { ++counts_[bin]; }
  [[nodiscard]] bool enough() const { return std::accumulate(counts_.begin(), counts_.end(), 0) >= kEnough; }

  /// In bins, interpolated within its bin.
  [[nodiscard]] double median() const {
    const double half = 0.5 * std::accumulate(counts_.begin(), counts_.end(), 0);
    double below = 0.0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      const double here = counts_[bin];
      if (below + here >= half) return static_cast<double>(bin) + (half - below) / std::max(here, 1.0);
      below += here;
    }
    return kBins;
  }

  static constexpr std::size_t kBins = 256;

 private:
  static constexpr int kEnough = 8;
  std::array<int, kBins> counts_{};
};

}  // namespace

DotNoise noise_of(const PixelSet& pixels, double saturated_level) {
  float steepest = 0.0F;
  float sum = 0.0F;
  for (std::size_t i = 0; i < pixels.used; ++i) {
    steepest = std::max(steepest, std::abs(pixels.slope[i]));
    sum += std::abs(pixels.residual[i]);
  }
  // The medians of the parts lie below some times the mean of all.
  constexpr float kRange = 4.0F;
  const float width = std::max(kRange * sum / static_cast<float>(pixels.used) / Histogram::kBins, 1e-6F);
  const float per_width = 1.0F / width;
  const auto saturated = static_cast<float>(saturated_level);
  constexpr float kLast = Histogram::kBins - 1;
  Histogram outer, inner, edge;
  for (std::size_t i = 0; i < pixels.used; ++i) {
    // Where the image is cut off, the residual says nothing of the noise.
    if (pixels.grey[i] >= saturated) continue;
    const auto bin = static_cast<std::size_t>(std::min(std::abs(pixels.residual[i]) * per_width, kLast));
    (pixels.inside[i] < 0.5F ? outer : inner).add(bin);
    if (std::abs(pixels.slope[i]) > 0.4F * steepest) edge.add(bin);
  }
  // Residuals of an adjustment are smaller than the noise by what its parameters took up.
  const double redundancy =
      1.0 - static_cast<double>(kDotColumns) / static_cast<double>(std::max<std::size_t>(pixels.used, 24));
  const double per_bin = kMadToSigma * static_cast<double>(width) / std::sqrt(redundancy);
  DotNoise noise;
  noise.steepest = std::max(static_cast<double>(steepest), 1e-6);
  if (outer.enough()) noise.outer = std::max(kQuantisation, per_bin * outer.median());
  noise.inner = inner.enough() ? std::max(kQuantisation, per_bin * inner.median()) : noise.outer;
  if (edge.enough()) noise.edge = per_bin * edge.median();
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
