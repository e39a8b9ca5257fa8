#pragma once

#include <cstddef>

namespace crosstie::markers::detail {

/// The loops over the pixels of one dot, compiled for several instruction sets and chosen at run time. Raw pointers, and no Eigen
/// in this file's source: objects built for AVX may not exchange its types with the rest. Sums run in single precision in as many
/// lanes as the machine has, so that instruction sets differ by rounding: by less than 1e-5 of a centre's sigma.

inline constexpr int kDotColumns = 12;    ///< parameters of the model, in the order of DotModel
inline constexpr int kEdgeHarmonics = 6;  ///< cosines and sines of 3, 4, 5 periods round the edge
inline constexpr int kAllColumns = kDotColumns + kEdgeHarmonics;
inline constexpr std::size_t kPixelPadding = 16;  ///< counts of pixels are multiples of it

/// The blurred ellipse of dot_fit.h; lengths in units of a radius R, levels in grey levels.
struct DotModel {
  float cx, cy, axx, axy, ayy, blur, o, ox, oy, i, ix, iy;
  float saturated;  ///< levels are cut off here
};

/// Pixels as one array for each property; `count` is a multiple of kPixelPadding, the last ones have no weight.
struct DotPixels {
  const float* x;
  const float* y;
  const float* grey;
  const float* weight;  ///< 1 / variance
  const float* limit2;  ///< square of the residual from which on a pixel loses weight
  std::size_t count;
};

/// Model and residuals (grey minus model, both cut off at saturation) at all pixels. `inside` is the share of the dot's level,
/// `slope` the derivative of the grey level by the distance [1/R]; 0 where the model is cut off.
void evaluate_dot(const DotModel& model, const float* x, const float* y, const float* grey, std::size_t count, float* residual,
                  float* inside, float* slope);

/// Sums over the pixels for one step of the adjustment.
struct DotSums {
  double normal[kAllColumns * kAllColumns];  ///< J' W J, column by column, upper triangle
  double right[kAllColumns];                 ///< J' W r
  double cost;                               ///< of the robust residuals
  double squares;                            ///< r' r over the pixels with weight
  double edge;                               ///< sum of slope^2,
  double edge_lost;                          ///< and of what the outliers' weights took from it
};

/// `unit_from_offset` is null, or the four numbers (row by row) that take an offset from the centre to the unit circle: then the
/// harmonics 3, 4, 5 (cosine, sine) of the edge's distance are columns kDotColumns.. of the sums.
void sum_dot(const DotModel& model, const DotPixels& pixels, const float* unit_from_offset, DotSums& sums);

}  // namespace crosstie::markers::detail
