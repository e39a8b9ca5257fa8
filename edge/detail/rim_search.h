#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "edge/detail/rim_candidates.h"
#include "edge/hole_edge.h"

namespace crosstie::edge::detail {

/// Places whose edges were not taken, each with the reason: they tell why there is a gap.
using LostEdges = std::vector<std::pair<Eigen::Vector3d, std::string>>;

/// The edges of a hole's rim and the face in which it lies.
struct FoundRim {
  Face face;
  std::vector<RimCandidate> rim;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();  ///< of what the rim spans, in the face's plane
  double support = 0.0;                    ///< share of the directions from there in which the first edge is the rim
  std::vector<Eigen::Vector3d> others_mm;  ///< middles of other holes that are as well supported, nearly
};

/// The hole among the edges of a region (`options.roi_px`): the face on which many of them lie, nearest to the cameras; then the opening in it that the
/// edges surround best. Without a region, and where no rim is expected, openings are first looked for as the cameras see them, whatever their surfaces; of those in whose neighbourhood
/// a face with an opening is found, the best supported one is taken.
/// kNoUniqueSolution: no face; without a region also where the edges of no hole surround half of its middle.
base::Result<FoundRim> find_rim(const std::vector<RimCandidate>& candidates, const HoleEdgeOptions& options,
                                HoleEdge::Counts& counts, LostEdges& lost);

}  // namespace crosstie::edge::detail
