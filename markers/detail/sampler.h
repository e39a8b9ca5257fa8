#pragma once

#include <cmath>

#include "base/image.h"

namespace crosstie::markers::detail {

/// Grey levels of an image of either depth as doubles.
class Sampler {
 public:
  explicit Sampler(const base::ImageView& image) : image_(image) {}

  [[nodiscard]] double at(int x, int y) const {
    return image_.bits == 8 ? static_cast<double>(image_.row<std::uint8_t>(y)[x])
                            : static_cast<double>(image_.row<std::uint16_t>(y)[x]);
  }

  /// Whether bilinear() is defined at this place.
  [[nodiscard]] bool inside(double x, double y) const {
    return x >= 0.0 && y >= 0.0 && x < image_.width - 1 && y < image_.height - 1;
  }

  /// Bilinear between the four neighbours: good enough for levels, not for edges.
  [[nodiscard]] double bilinear(double x, double y) const {
    return image_.bits == 8 ? bilinear_of<std::uint8_t>(x, y) : bilinear_of<std::uint16_t>(x, y);
  }

  [[nodiscard]] const base::ImageView& image() const { return image_; }

 private:
  template <typename Sample>
  [[nodiscard]] double bilinear_of(double x, double y) const {
    const int ix = static_cast<int>(x);
    const int iy = static_cast<int>(y);
    const double fx = x - ix;
    const double fy = y - iy;
    const Sample* upper = image_.row<Sample>(iy) + ix;
    const Sample* lower = image_.row<Sample>(iy + 1) + ix;
    const double top = upper[0] + fx * (upper[1] - upper[0]);
    const double bottom = lower[0] + fx * (lower[1] - lower[0]);
    return top + fy * (bottom - top);
  }

  const base::ImageView& image_;
};

}  // namespace crosstie::markers::detail
