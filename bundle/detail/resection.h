#pragma once

#include <optional>
#include <vector>

#include "base/pose.h"
#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

struct Resection {
  base::Pose network_from_camera;
  int inliers = 0;
  int rays = 0;
};

/// The pose of an image from its active rays to known points: three-point poses of random samples, the best one refined on all
/// rays; near a plane the second minimum (the plane tilted the other way about the line of sight) is refined too, and the
/// better one taken. Nothing with fewer than four rays, or where fewer than four (or half of them) agree to `tolerance_px`.
std::optional<Resection> resect(const Survey& survey, const State& state,
                                const std::vector<std::optional<Eigen::Vector3d>>& directions, int image, double tolerance_px);

}  // namespace crosstie::bundle::detail
