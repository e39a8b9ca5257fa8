#pragma once

#include <vector>

#include "base/calibration.h"
#include "base/calibration_quality.h"
#include "base/result.h"

namespace crosstie::calib {

/// Distance at which the boards were seen: the median over all views [mm]; 0 without views.
[[nodiscard]] double working_distance_mm(const base::Calibration& calibration);

/// Uncertainty of projections, and of points that both cameras see, over the images at `distance_mm` (calib/uncertainty.h).
base::Result<base::CalibrationMaps> calibration_maps(const base::Calibration& calibration, double distance_mm);

/// The corners of each pair of images against the rig's epipolar geometry, by station. With l and r the rays of a corner in both
/// images, in the right camera's frame, and t the left projection centre there,
///     g = r . (t x l),    e = g / |dg / d(right pixel)|
/// is the distance of the right corner from the epipolar curve of the left one, to first order. Its expected size follows from
/// the sigma of a corner in both images. A mean far from zero, or a size above what is expected, means that lenses or rig do not fit
/// that pair: it moved while it was photographed, or the images were not taken at one moment.
[[nodiscard]] std::vector<base::EpipolarPair> epipolar_pairs(const base::Calibration& calibration);

/// Lenses and rig against an earlier calibration of cameras of the same names, at `distance_mm`. Cameras that the earlier one does
/// not know are left out.
[[nodiscard]] base::CalibrationChange calibration_change(const base::Calibration& previous, const base::Calibration& now,
                                                         double distance_mm);

}  // namespace crosstie::calib
