#include "markers/detail/exposure.h"

#include <cmath>
#include <cstdint>

#include "markers/detail/level_kernels.h"

namespace crosstie::markers::detail {
namespace {

template <typename Sample>
Exposure measure(const base::ImageView& image, double saturated, double dark) {
  const auto high = static_cast<Sample>(std::ceil(saturated));
  const auto low = static_cast<Sample>(std::floor(dark));
  LevelCounts counts;
  for (int y = 0; y < image.height; ++y) {
    const LevelCounts row = count_levels(image.row<Sample>(y), image.width, high, low);
    counts.high += row.high;
    counts.low += row.low;
  }
  const double all = static_cast<double>(image.width) * image.height;
  return {static_cast<double>(counts.high) / all, static_cast<double>(counts.low) / all};
}

}  // namespace

Exposure measure_exposure(const base::ImageView& image, double saturated_level, double dark_level) {
  const double saturated = saturated_level * image.white_level;
  const double dark = dark_level * image.white_level;
  return image.bits == 8 ? measure<std::uint8_t>(image, saturated, dark) : measure<std::uint16_t>(image, saturated, dark);
}

}  // namespace crosstie::markers::detail
