#pragma once

#include <cstddef>
#include <cstdint>

namespace crosstie::scan::detail {

/// The loops over the pixels of fringe images, compiled for several instruction sets and chosen at run time. Raw pointers, no Eigen.

inline constexpr int kMaxSteps = 64;

/// How a set of fringe images is solved: level_n = A + a cos(2 pi shift_n) + b sin(2 pi shift_n) by least squares.
struct FringePlan {
  int steps = 0;
  float cosine[kMaxSteps];
  float sine[kMaxSteps];
  float mean_weight[kMaxSteps];  ///< A, a and b are these sums over the levels
  float a_weight[kMaxSteps];
  float b_weight[kMaxSteps];
  float square_weight = 0.0F;  ///< of the squared residuals
  float clip_low = 0.0F;       ///< levels at or below, at or above these count as cut off
  float clip_high = 0.0F;
};

/// Of each pixel. Every array is as long as the row.
struct FringeRow {
  float* turns;           ///< phase in [0, 1): the x with level = A + B cos(2 pi (x - shift))
  float* modulation;      ///< B
  float* mean;            ///< A
  float* squares;         ///< weighted sum of the squared residuals
  std::uint8_t* clipped;  ///< whether any sample is cut off
};

/// `images` are the row's samples in each of the images. Returns whether a sample of any pixel is cut off.
bool solve_fringes(const FringePlan& plan, const std::uint8_t* const* images, std::size_t count, const FringeRow& row);
bool solve_fringes(const FringePlan& plan, const std::uint16_t* const* images, std::size_t count, const FringeRow& row);

}  // namespace crosstie::scan::detail
