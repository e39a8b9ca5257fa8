#pragma once

#include <vector>

#include "app/job.h"
#include "app/verb.h"
#include "base/calibration.h"
#include "base/calibration_quality.h"
#include "base/machine.h"
#include "base/network.h"
#include "base/verdict.h"
#include "base/verification.h"

namespace crosstie::app {

/// Values of an adjustment held against the job's limits.
std::vector<base::Verdict> judge(const base::AdjustedNetwork& network, const JobLimits& limits);
/// Values of a verification held against the job's limits.
std::vector<base::Verdict> judge(const base::Verification& verification, const JobLimits& limits);

/// Values of a commissioning, held against the limits and against the head as it was calibrated.
std::vector<base::Verdict> judge(const base::Commissioning& result, const base::Head& calibrated, const JobLimits& limits);
/// A changed head is no fault of its calibration: never more than a WARNING.
std::vector<base::Verdict> judge(const base::CalibrationChange& change, const JobLimits& limits);
/// Values of a calibration held against the limits; docs/formats.md tells where these come from.
std::vector<base::Verdict> judge(const base::Calibration& calibration, const JobLimits& limits);

/// kVerdictFailed where one of them is a FAIL.
Outcome outcome_of(const std::vector<base::Verdict>& verdicts);

}  // namespace crosstie::app
