#pragma once

#include <string>
#include <vector>

#include "base/plan.h"
#include "report/commissioning_report.h"
#include "report/context.h"

namespace crosstie::report {

/// One self-contained HTML page on what a scene promises: sigmas at the planned points, of the head along its travel and over the
/// working volume, the smallest error motions that are found, points of a photographic network, the head's calibration, what other numbers
/// of stations, photographs, markers would give, and whether rehearsals confirm it. `volume` may be empty.
std::string plan_report(const base::ScenePlan& plan, const std::vector<VolumeMap>& volume, const ReportContext& context);

}  // namespace crosstie::report
