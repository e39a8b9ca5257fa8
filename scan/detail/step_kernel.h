#pragma once

#include <array>
#include <cstddef>

namespace crosstie::scan::detail {

/// The loop over the pixels of a piece of edge (step_profile.h), compiled for several instruction sets and chosen at run time. Raw pointers,
/// no Eigen.

inline constexpr std::size_t kMostEdgeImages = 3;
inline constexpr std::size_t kMostSteps = 3;
inline constexpr std::size_t kStepLanes = 8;  ///< arrays of samples are filled up to a multiple of it

/// Pixels by their distance from the edge, `padded` of them: those that fill up lie at kBeforeAll_px, where no step has begun.
struct StepSamples {
  const double* across_px = nullptr;
  std::array<const double*, kMostEdgeImages> levels = {};
  std::size_t padded = 0;
  std::size_t images = 0;
};
inline constexpr double kBeforeAll_px = -1e6;

/// Sums over the samples; Phi_j is the normal distribution about the j-th place, phi_j its density (its derivative by across_px).
struct StepSums {
  std::array<double, kMostSteps> step = {};                                   ///< Phi_j
  std::array<std::array<double, kMostSteps>, kMostSteps> steps = {};          ///< Phi_j Phi_l, l <= j
  std::array<double, kMostSteps> slope = {};                                  ///< phi_j
  std::array<std::array<double, kMostSteps>, kMostSteps> cross = {};          ///< Phi_j phi_l
  std::array<std::array<double, kMostSteps>, kMostSteps> slopes = {};         ///< phi_j phi_l, l <= j
  std::array<std::array<double, kMostSteps>, kMostEdgeImages> by_step = {};   ///< Phi_j times an image's levels
  std::array<std::array<double, kMostSteps>, kMostEdgeImages> by_slope = {};  ///< phi_j times them
};

/// For `count` places, 1 to kMostSteps, and 1 to kMostEdgeImages images.
StepSums sum_steps(const StepSamples& samples, double blur_px, const double* places_px, std::size_t count);

}  // namespace crosstie::scan::detail
