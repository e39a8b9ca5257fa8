#pragma once

#include "markers/detail/dot_pixels.h"

namespace crosstie::markers::detail {

/// Standard deviations in grey levels at the dark and the bright end of the edge, and how far pixels on the edge may be off
/// before they count as outliers: a lens does not blur exactly like a Gaussian, which shows where the slope is steep.
struct DotNoise {
  double outer = 1.0;
  double inner = 1.0;
  double edge = 0.0;
  double steepest = 1.0;  ///< largest |slope|, at which `edge` holds
};

/// From the residuals of the model that `pixels` was evaluated for: their medians inside, outside and on the edge apart, since
/// brighter pixels are noisier.
[[nodiscard]] DotNoise noise_of(const PixelSet& pixels, double saturated_level);

/// Sets the weights and outlier limits of the pixels for that model.
void weigh(const DotNoise& noise, PixelSet& pixels);

/// The same for noise of one standard deviation everywhere, without a model.
void weigh_equally(double sigma, PixelSet& pixels);

}  // namespace crosstie::markers::detail
