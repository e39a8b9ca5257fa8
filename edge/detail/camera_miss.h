#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

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
  int cells = 0;                                               ///< that both cameras saw
  int places = 0;                                              ///< of texture that told it instead; 0: the cells did
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();         ///< in the left image, where it is that large,
  Eigen::Vector2d slope_rad_per_px = Eigen::Vector2d::Zero();  ///< and how it changes from there
};

/// The misses of all stations that are told from nothing: least squares over the cells that both cameras saw, robust, since
/// in some the cameras see different edges of a chamfer.
std::vector<CameraMiss> camera_misses(const RimCells& cells);

/// Lets the texture about the rim tell the misses, where the scan found enough: a rim whose chamfer looks different from both sides tells them less
/// well than the face does. A calibration is off by another amount in each part of the image, so it is a local linear regression over the left image
/// (Cleveland, JASA 74, 1979: tricube weights over the nearest places, and robust).
void take_from_texture(std::vector<CameraMiss>& misses, std::span<const StationView> stations,
                       const std::vector<RimCandidate>& rim);

/// Moves what the cameras see half way towards each other: neither is known better. The depths lie on the left one's rays and turn with them, the
/// right one's edges come to where they meet that surface.
void meet_half_way(const std::vector<CameraMiss>& misses, std::vector<RimCandidate>& rim);

}  // namespace crosstie::edge::detail
