#pragma once

#include "base/calibration.h"
#include "base/result.h"
#include "calib/calibrate.h"
#include "calib/detail/problem.h"

namespace crosstie::calib::detail {

/// The rig against the distance that was expected, with a guess at what went wrong. Error kBadInput where it is off by more than a
/// quarter.
base::Result<> check_baseline(const base::Calibration& result, const CalibrateOptions& options);

/// Adds the warnings that the result itself gives reason for: few or untilted views, uncovered image, correlated or weak parameters,
/// swapped or unpaired images, bad views, a board that contradicts its prior, halves that contradict each other.
void add_findings(const Problem& problem, base::Calibration& result);

}  // namespace crosstie::calib::detail
