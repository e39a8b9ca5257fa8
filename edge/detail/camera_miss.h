#pragma once

#include <vector>

#include "edge/detail/rim_candidates.h"
#include "edge/detail/rim_line.h"

namespace crosstie::edge::detail {

/// By what the cameras of a station miss each other at the rim: the right one's rays are turned about the base against the left one's, so that
/// they pass each other across the epipolar planes. Phases in one direction do not show it: depths follow from the way along the epipolar lines.
/// At a rim it moves the edges of one camera against those of the other by `angle_rad` times RimCandidate::slide_mm, most where the rim runs
/// along the base.
struct CameraMiss {
  int station = 0;
  double angle_rad = 0.0;  ///< right minus left, about the way from the left to the right camera
  double sigma_rad = 0.0;
  int cells = 0;  ///< that both cameras saw
};

/// The misses of all stations that are told from nothing: least squares over the cells that both cameras saw, robust, since
/// in some the cameras see different edges of a chamfer.
std::vector<CameraMiss> camera_misses(const RimCells& cells);

/// Moves what the cameras see half way towards each other: neither is known better. The depths lie on the left one's rays and turn with them, the
/// right one's edges come to where they meet that surface.
void meet_half_way(const std::vector<CameraMiss>& misses, std::vector<RimCandidate>& rim);

}  // namespace crosstie::edge::detail
