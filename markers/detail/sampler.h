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
    const int ix = static_cast<int>(x);
    const int iy = static_cast<int>(y);
    const double fx = x - ix;
    const double fy = y - iy;
    const double top = at(ix, iy) + fx * (at(ix + 1, iy) - at(ix, iy));
    const double bottom = at(ix, iy + 1) + fx * (at(ix + 1, iy + 1) - at(ix, iy + 1));
    return top + fy * (bottom - top);
  }

  [[nodiscard]] const base::ImageView& image() const { return image_; }

 private:
  const base::ImageView& image_;
};

}  // namespace crosstie::markers::detail
