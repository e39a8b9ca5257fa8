#pragma once

#include <optional>

#include "base/image.h"

namespace crosstie::live {

/// How sharp the strongest edges of an image are, 0..1.
///
/// Where a profile along a row or a column rises or falls steadily over six pixels, its change over the two pixels round the middle is
/// held against its change over all six, r = |I(+1) - I(-1)| / |I(+3) - I(-3)|. For a step through a Gaussian of standard deviation s (lens
/// and pixel together) r = erf(1 / (s sqrt 2)) / erf(3 / (s sqrt 2)): 1 for a perfect edge, 1/3 for a ramp without an end. The focus number is
/// (3 r - 1) / 2 of the median over the edges of at least half the contrast of the strongest ones. With edges anywhere within their pixels:
///
///     s [px]     0.4    0.6    0.8    1.0    1.5    2.0    3.0    4.0
///     focus      0.95   0.81   0.65   0.51   0.27   0.16   0.07   0.04
///
/// Gain, exposure and black level cancel; neither does it depend on the size of things as long as they are 7 pixels wide: it is no sum
/// of squared gradients, which grow with light and with the amount of texture. It judges the lens for one scene, where it is to be made as
/// large as possible; edges that are round or painted softly by themselves lower it.
///
/// Domain: s from 0.3 to 4 px; contrasts of at least 24 of 255 grey levels; saturated edges take no part, since clipping makes them
/// steeper. Nothing where fewer than 20 edges are left.
[[nodiscard]] std::optional<double> focus_number(const base::ImageView& image, double saturated_level = 0.992);

}  // namespace crosstie::live
