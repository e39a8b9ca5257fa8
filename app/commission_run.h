#pragma once

#include <functional>

#include "app/commission_input.h"
#include "app/steps.h"

namespace crosstie::app {

/// Hears of each step that was done.
using TellStep = std::function<void(const char* verb, const StepOutcome&)>;

/// Does what a commissioning needs beforehand where it is out of date: calibrate (of cameras with board images), detect and adjust (of a
/// cross that the job measures itself), and the detection in the stations' photographs.
base::Result<CommissionSources> commission_sources(const Job& job, const std::filesystem::path& results, const TellStep& tell,
                                                   Session& session);

}  // namespace crosstie::app
