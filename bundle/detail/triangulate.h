#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

/// The direction (unit length, in camera) of every ray with the present lenses; nothing where the lens model has none.
std::vector<std::optional<Eigen::Vector3d>> ray_directions(const Survey& survey, const State& state);

/// The point nearest to several straight lines, in the least squares of its distances from them; nothing for parallel lines.
std::optional<Eigen::Vector3d> nearest_point(const std::vector<Eigen::Vector3d>& origins,
                                             const std::vector<Eigen::Vector3d>& directions);

struct Triangulation {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  std::vector<int> rays;   ///< those that agree with it to within the tolerance
  double angle_rad = 0.0;  ///< largest angle between two of them
};

/// The place on which most of `candidates` (rays of one point in oriented images) agree to `tolerance_px`, found by trying
/// pairs of rays that meet at `min_angle_rad` or more and refined on all that agree. Nothing where no two agree.
std::optional<Triangulation> triangulate(const Survey& survey, const State& state,
                                         const std::vector<std::optional<Eigen::Vector3d>>& directions,
                                         const std::vector<int>& candidates, double tolerance_px, double min_angle_rad);

/// Largest angle between two of the given rays at their point.
double largest_angle(const Survey& survey, const State& state, const std::vector<int>& rays);

}  // namespace crosstie::bundle::detail
