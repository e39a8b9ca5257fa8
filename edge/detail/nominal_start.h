#pragma once

#include <vector>

#include "base/edge_curve.h"
#include "base/pose.h"
#include "edge/nominal.h"

namespace crosstie::edge::detail {

/// Where a fit of a nominal hole may begin.
struct NominalStart {
  Nominal nominal;  ///< with sizes
  base::Pose frame_from_hole;
  double mean_square = 0.0;  ///< of the distances of some of the points
};

/// Starts from the points' plane, extents and turns about its normal, the best ones first; empty where the points have no extent.
[[nodiscard]] std::vector<NominalStart> nominal_starts(const base::EdgeCurve& edge, const Nominal& nominal);

}  // namespace crosstie::edge::detail
