#pragma once

#include <vector>

#include "app/job.h"
#include "base/machine.h"
#include "base/result.h"

namespace crosstie::app {

/// The balls as the machine found them: centres from a list, or fitted to the touches of the probe. Where the cross's list gives a
/// ball's diameter, the fit of its centre takes it as an observation, and the diameter that the touches give by themselves is kept to be
/// held against it. Touches whose form error is far above the probe's sigma are a warning.
base::Result<std::vector<base::ProbedSphere>> probed_spheres(const Job& job, const std::vector<base::ReferenceSphere>& known,
                                                             std::vector<base::Warning>& warnings);

}  // namespace crosstie::app
