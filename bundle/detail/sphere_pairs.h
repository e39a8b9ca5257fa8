#pragma once

#include <vector>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::bundle::detail {

/// A ball of the cross with its probing.
struct SpherePair {
  int id = 0;
  int reference = 0;  ///< index into Cross::spheres
  int probed = 0;     ///< index into the probed ones
  bool active = true;
  std::string reason = {};
};

struct SpherePairs {
  std::vector<SpherePair> pairs;  ///< by id
  base::Pose machine_from_cross;
  std::string datum;       ///< in words
  double scale_ppm = 0.0;  ///< of the probed distances over the grown list's; see Commissioning::sphere_scale_ppm
  double scale_sigma_ppm = 0.0;
  std::vector<base::Warning> warnings;
};

/// Joins the balls by their ids and holds their distances and diameters against each other before anything is adjusted. A ball that
/// alone contradicts all others by far is set aside with its reason.
///
/// Errors: kNoUniqueSolution for fewer than three balls, balls on one line, and masks that leave the frame free; kBadInput for balls
/// that are swapped (named), coordinates in inches, a left-handed frame, diameters that are not those of the list.
base::Result<SpherePairs> pair_spheres(const base::Cross& cross, const std::vector<base::ProbedSphere>& probed);

}  // namespace crosstie::bundle::detail
