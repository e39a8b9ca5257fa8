#pragma once

#include <span>

#include <Eigen/Core>

#include "base/stitching.h"

namespace crosstie::registration {

/// The shape of the scanned part, from points of its surface: a cylinder or cone from which they deviate by less than a tenth of what they
/// deviate from a plane; else a plane, where that is less than a thousandth of their width. Kind::kNone where none does.
/// `threads` 0: as many as the machine has; no effect on the outcome.
base::Segment fit_segment(std::span<const Eigen::Vector3d> points_mm, int threads);

}  // namespace crosstie::registration
