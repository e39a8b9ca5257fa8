#pragma once

#include <vector>

#include "base/machine.h"
#include "bundle/commission.h"
#include "report/commissioning_report.h"

namespace crosstie::app {

/// What the report shows beside the result: the head as it was calibrated, the axis and the frame's uncertainty sampled over travel and
/// working volume. Refers to both arguments.
report::CommissioningView commissioning_view(const base::Commissioning& result, const bundle::CommissionInput& input);

/// U by the frame alone over planes of the working volume.
std::vector<report::VolumeMap> volume_maps(const base::Commissioning& result);

/// Largest expanded uncertainty (k = 2, worst direction) of a point of the working volume by the frame alone.
double largest_frame_u_mm(const base::Commissioning& result);

}  // namespace crosstie::app
