#pragma once

#include <string>

#include "base/calibration.h"
#include "base/calibration_quality.h"
#include "report/context.h"

namespace crosstie::report {

/// The whole report of a calibration as one HTML file that needs nothing else: verdict, key figures, what was photographed, residuals
/// and coverage of each camera, lens parameters, rig, board, uncertainty over the image, pairs of images, change since an earlier calibration, how well views are predicted that took no part, lens models,
/// detectors, another program's answer, what was left out.
std::string calibration_report(const base::Calibration& calibration, const base::CalibrationQuality& quality,
                               const ReportContext& context);

}  // namespace crosstie::report
