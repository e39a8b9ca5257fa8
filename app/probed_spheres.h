#pragma once

#include <vector>

#include "app/job.h"
#include "base/machine.h"
#include "base/result.h"
#include "base/sphere_list.h"
#include "math/probed_sphere.h"

namespace crosstie::app {

/// The balls as the machine found them: centres from a list, or fitted to the touches of the probe. Where the cross's list gives a
/// ball's diameter, the fit of its centre takes it as an observation, and the diameter that the touches give by themselves is kept to be
/// held against it. Touches whose form error is far above the probe's sigma are a warning.
base::Result<std::vector<base::ProbedSphere>> probed_spheres(const Job& job, const std::vector<base::ReferenceSphere>& known,
                                                             std::vector<base::Warning>& warnings);

/// The same of one ball's touches; `known` is its entry in the cross's list, or null.
base::Result<base::ProbedSphere> probed_sphere(const base::ProbeHits& hits, const base::ReferenceSphere* known,
                                               math::SphereProbingOptions options, std::vector<base::Warning>& warnings);

}  // namespace crosstie::app
