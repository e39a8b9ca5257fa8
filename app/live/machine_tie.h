#pragma once

#include "base/machine.h"
#include "base/result.h"
#include "live/spatial.h"

namespace crosstie::app {

/// Where the head and the markers of the cross are in machine at a reading of the axis, with the joint covariance of both and of the
/// head itself, as a commissioning left them. Errors: kBadInput for a reading outside of the travel, and where the covariance does not
/// belong to the commissioning.
base::Result<live::MachineTie> machine_tie(const base::Commissioning& commissioning, double axis_mm);

}  // namespace crosstie::app
