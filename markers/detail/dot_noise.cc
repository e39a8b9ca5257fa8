#include "markers/detail/dot_noise.h"

#include <algorithm>
#include <cmath>

namespace crosstie::markers::detail {
namespace {

constexpr double kOutlier = 4.0;       // standard deviations from which on a pixel loses weight
constexpr double kQuantisation = 0.3;  // grey levels: no pixel is better than the rounding of its level
constexpr double kMadToSigma = 1.4826;
constexpr std::size_t kEnough = 8;

double median_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

}  // namespace

DotNoise noise_of(const PixelSet& pixels, double saturated_level) {
  std::vector<float> outer, inner, edge;
  outer.reserve(pixels.used);
  inner.reserve(pixels.used);
  edge.reserve(pixels.used);
  float steepest = 0.0F;
  for (std::size_t i = 0; i < pixels.used; ++i) steepest = std::max(steepest, std::abs(pixels.slope[i]));
  const auto saturated = static_cast<float>(saturated_level);
  for (std::size_t i = 0; i < pixels.used; ++i) {
    // Where model or image is cut off, the residual says nothing of the noise.
    if (pixels.grey[i] >= saturated) continue;
    const float residual = std::abs(pixels.residual[i]);
    (pixels.inside[i] < 0.5F ? outer : inner).push_back(residual);
    if (std::abs(pixels.slope[i]) > 0.4F * steepest) edge.push_back(residual);
  }
  DotNoise noise;
  noise.steepest = std::max(static_cast<double>(steepest), 1e-6);
  if (outer.size() >= kEnough) noise.outer = std::max(kQuantisation, kMadToSigma * median_of(outer));
  noise.inner = inner.size() >= kEnough ? std::max(kQuantisation, kMadToSigma * median_of(inner)) : noise.outer;
  if (edge.size() >= kEnough) noise.edge = kMadToSigma * median_of(edge);
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

}  // namespace crosstie::markers::detail
