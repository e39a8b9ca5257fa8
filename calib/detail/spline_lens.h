#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/camera.h"
#include "calib/detail/problem.h"
#include "calib/detail/state.h"

namespace crosstie::calib::detail {

/// A cubic splined model whose grid covers the images of all cameras with the lenses of `state`: 10 control points across (seven
/// intervals), as many down as it takes. Nothing where a lens folds within half of its image.
std::optional<base::LensModel> spline_for(const Problem& problem, const State& state);

/// The splined lens that comes nearest to a lens of OpenCV's models over the grid: the same focal lengths and principal point, the
/// control points by least squares. It is the mean of the control points' prior (see kSplineSigma).
Eigen::VectorXd as_spline(const Eigen::VectorXd& lens, base::LensModel from, base::LensModel spline);

/// [px] of the displacement that a control point makes at the focal length: how far a lens is expected to leave its OpenCV model.
/// Without such a prior, control points in corners that no image filled would be free.
inline constexpr double kSplineSigma_px = 1.0;

}  // namespace crosstie::calib::detail
