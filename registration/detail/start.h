#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "base/stitching.h"
#include "math/rigid_alignment.h"
#include "registration/stitch.h"

namespace crosstie::registration::detail {

/// The motion on which most pairs agree.
struct Consensus {
  base::Pose a_from_b;
  base::Matrix6d cov = base::Matrix6d::Zero();
  std::vector<bool> agrees;  ///< of each pair
  int agreeing = 0;
};

/// Tries the motions of three pairs each (all of them, or some hundred drawn with a fixed seed) and keeps the one with most pairs within
/// tolerance_mm and five sigmas, refined on these. Nothing where no three pairs that span a plane agree.
std::optional<Consensus> find_consensus(const std::vector<math::AlignmentPair>& pairs, double tolerance_mm);

/// Where the adjustment begins.
struct Start {
  std::vector<base::Pose> machine_from_rig;
  std::optional<base::Pose> machine_from_part;  ///< where the list has a frame of its own beside the axis
  bool datum_is_first = false;                  ///< nothing but the first station tells the frame
  double sigma_mm = 0.0;                        ///< of a station against its neighbour, about
  std::vector<std::vector<bool>> active;        ///< of each station's sightings
  std::vector<bool> listed;                     ///< of each point of the list
  std::vector<base::RejectedSighting> rejected;
};

/// Poses from the axis, from poses that the stations bring, or from a chain of consensuses of common markers; with the sightings that no
/// consensus holds, and why. Errors: kNoUniqueSolution for a station that nothing joins to the others; kBadInput where stations have
/// three markers and more in common of which no three agree, and for readings outside of the travel.
base::Result<Start> find_start(const StitchInput& input, const StitchOptions& options);

}  // namespace crosstie::registration::detail
