#pragma once

#include <string>
#include <vector>

#include "base/calibration.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

/// The parts of the calibration report; each returns finished markup.
std::vector<KeyFigure> calibration_key_figures(const base::Calibration& calibration);
std::string calibration_cameras_section(const base::Calibration& calibration);
std::string calibration_rig_section(const base::CalibratedRig& rig);
std::string calibration_residuals_section(const base::Calibration& calibration);
std::string calibration_views_section(const base::Calibration& calibration);
std::string calibration_board_section(const base::CalibratedBoard& board);
std::string calibration_validation_section(const base::Calibration& calibration);
std::string calibration_trials_section(const base::Calibration& calibration);
std::string calibration_rejected_section(const base::Calibration& calibration);

}  // namespace crosstie::report::detail
