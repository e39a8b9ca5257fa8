#pragma once

#include <string>

#include "base/calibration.h"
#include "base/calibration_quality.h"

namespace crosstie::report::detail {

/// Parts of the calibration report; finished markup.
std::string calibration_maps_section(const base::Calibration& calibration, const base::CalibrationMaps& maps);
std::string calibration_epipolar_section(const std::vector<base::EpipolarPair>& pairs);
std::string calibration_change_section(const base::CalibrationChange& change);

}  // namespace crosstie::report::detail
