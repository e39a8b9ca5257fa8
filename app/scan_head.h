#pragma once

#include <array>

#include "app/steps_scan.h"
#include "base/machine.h"
#include "base/phase_map.h"
#include "base/scan_summary.h"

namespace crosstie::app {

/// What the scan itself says of its head's calibration: by both phases, else by texture. Not done where there is neither.
/// Errors: kBadInput that names what is wrong where the calibration cannot be that of the head, or the two cameras' images are
/// exchanged; those of texture_samples().
base::Result<base::HeadTest> tested_head(const ScanTask& task, const base::Head& head,
                                         const std::array<base::PhaseMap, 2>& maps, const scan::DepthMap& depths,
                                         const base::Progress& progress);

}  // namespace crosstie::app
