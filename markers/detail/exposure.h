#pragma once

#include "base/image.h"

namespace crosstie::markers::detail {

struct Exposure {
  double saturated_fraction = 0.0;
  double dark_fraction = 0.0;
};

/// Fractions of the pixels at or above, and at or below, these fractions of the white level.
Exposure measure_exposure(const base::ImageView& image, double saturated_level, double dark_level);

}  // namespace crosstie::markers::detail
