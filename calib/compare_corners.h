#pragma once

#include <string>

#include "base/calibration.h"
#include "calib/calibrate.h"

namespace crosstie::calib {

/// What the corners of another detector make of the same images: the calibration with them under the lens and the other options of
/// `options` (without cross-validation), and how far they lie from those that were used. The choice of a detector moves a baseline by
/// more than its sigma (docs/formulation.md); the two side by side show by how much.
/// Corners of a board that looks the same when turned are compared in the order that brings them nearer.
base::DetectorTrial compare_corners(const std::string& detector, const BoardViews& corners, const BoardViews& used,
                                    base::LensModel lens, CalibrateOptions options = {}, const base::Progress& progress = {});

}  // namespace crosstie::calib
