#pragma once

#include "base/image.h"
#include "base/observation.h"

namespace crosstie::markers {

/// Which grey levels an operator is warned of; the defaults are those of DetectOptions.
struct OverlayOptions {
  double saturated_level = 0.992;  ///< [-] of the white level: at or above it a pixel is painted red
  double dark_level = 0.02;        ///< [-] of the white level: at or below it a pixel is painted blue
};

/// The picture that an operator looks at: the grey image with over-exposed pixels red and under-exposed ones blue, and every
/// observation with its ellipse and a cross in the centre: coded green with its id, uncoded cyan, all others yellow (with the
/// id where one was read). The picture has the image's size; 16-bit grey levels are scaled by the white level.
[[nodiscard]] base::ColourImage overlay(const base::ImageView& image, const base::ImageObservations& observations,
                                        const OverlayOptions& options = {});

}  // namespace crosstie::markers
