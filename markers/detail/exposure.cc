#include "markers/detail/exposure.h"

#include <cmath>
#include <cstdint>

namespace crosstie::markers::detail {
namespace {

template <typename Sample>
Exposure measure(const base::ImageView& image, double saturated, double dark) {
  const auto high = static_cast<Sample>(std::ceil(saturated));
  const auto low = static_cast<Sample>(std::floor(dark));
  std::int64_t saturated_pixels = 0;
  std::int64_t dark_pixels = 0;
  for (int y = 0; y < image.height; ++y) {
    const Sample* row = image.row<Sample>(y);
    int over = 0;
    int under = 0;
    for (int x = 0; x < image.width; ++x) {
      over += row[x] >= high ? 1 : 0;
      under += row[x] <= low ? 1 : 0;
    }
    saturated_pixels += over;
    dark_pixels += under;
  }
  const double all = static_cast<double>(image.width) * image.height;
  return {static_cast<double>(saturated_pixels) / all, static_cast<double>(dark_pixels) / all};
}

}  // namespace

Exposure measure_exposure(const base::ImageView& image, double saturated_level, double dark_level) {
  const double saturated = saturated_level * image.white_level;
  const double dark = dark_level * image.white_level;
  return image.bits == 8 ? measure<std::uint8_t>(image, saturated, dark) : measure<std::uint16_t>(image, saturated, dark);
}

}  // namespace crosstie::markers::detail
