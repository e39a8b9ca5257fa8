#pragma once

#include <Eigen/Core>

#include "base/lens_model.h"

namespace crosstie::base::detail {

/// base::project_bare of a splined stereographic model, computed by libmrcal. Outside of the area that the grid covers the
/// polynomials of its border are extrapolated.
bool project_splined(LensModel model, const double* parameters, const double* p_in_camera, double* pixel, double* d_point,
                     double* d_parameters);

/// Half width and half height of the area of u = 2 (X, Y) / (|p| + Z) that the grid covers, about u = 0. Beyond it lies one more
/// knot of a cubic spline, half an interval of a quadratic one.
Eigen::Vector2d half_extent(const SplineGrid& grid);

}  // namespace crosstie::base::detail
