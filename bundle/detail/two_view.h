#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/pose.h"

namespace crosstie::bundle::detail {

/// How far the directions to common points differ between two images after the best rotation: root mean square [rad]. Zero for
/// images from one place; large for a long base.
double parallax(const std::vector<Eigen::Vector3d>& directions_a, const std::vector<Eigen::Vector3d>& directions_b);

/// Candidate motions a_from_b between two views of the same points, to be tried in this order: those of the homography (a plane
/// allows two) and that of the essential matrix (any shape but a plane). Translations have an arbitrary length. Robust
/// against wrong pairs; `tolerance_rad` is what an unknown lens may bend a direction. Six pairs or more.
std::vector<base::Pose> relative_poses(const std::vector<Eigen::Vector3d>& directions_a,
                                       const std::vector<Eigen::Vector3d>& directions_b, double tolerance_rad);

}  // namespace crosstie::bundle::detail
