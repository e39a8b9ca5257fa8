#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace crosstie::math::detail {

/// Points of a Fibonacci lattice on the unit sphere, about sqrt(4 pi / count) rad apart; `half`: those with z >= 0 only, `count`
/// of them.
[[nodiscard]] std::vector<Eigen::Vector3d> lattice_directions(int count, bool half);

/// A direction and the value of the function that is minimised there.
struct DirectionMinimum {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double value = 0.0;
};

/// Pattern search from `start`: steps to eight sides, halved where none is lower, from `step_rad` down to `least_rad`.
[[nodiscard]] DirectionMinimum refined_direction(const std::function<double(const Eigen::Vector3d&)>& value,
                                                 const Eigen::Vector3d& start, double step_rad, double least_rad);

}  // namespace crosstie::math::detail
