#pragma once

#include <Eigen/Core>

#include "base/camera.h"
#include "base/detail/distortion.h"

namespace crosstie::base::detail {

/// Any lens model in the terms of one formula: pixel = (fx x' + cx, fy y' + cy) of the distorted (x', y'). Of a splined model
/// the first four only.
struct Lens {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  Distortion distortion{};
};

[[nodiscard]] Lens lens_of(LensModel model, const double* parameters);

/// fx fy cx cy and the distortion's parameters, as one list.
inline constexpr int kLensTerms = 4 + kMaxDistortion;

/// d pixel / d parameters of kAicon from the derivatives by the lens's terms: `u` and `v` hold kLensTerms values each, the rows
/// of `d_parameters` parameter_count(kAicon).
void aicon_derivatives(const double* parameters, const double* u, const double* v, double* d_parameters);

}  // namespace crosstie::base::detail
