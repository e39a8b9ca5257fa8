#include "math/detail/sphere_search.h"

#include <cmath>
#include <numbers>

#include "math/detail/shape_state.h"

namespace crosstie::math::detail {

std::vector<Eigen::Vector3d> lattice_directions(int count, bool half) {
  const double golden_rad = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double share = (i + 0.5) / count;
    const double z = half ? 1.0 - share : 1.0 - 2.0 * share;
    const double r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(golden_rad * i), r * std::sin(golden_rad * i), z);
  }
  return directions;
}

DirectionMinimum refined_direction(const std::function<double(const Eigen::Vector3d&)>& value, const Eigen::Vector3d& start,
                                   double step_rad, double least_rad) {
  DirectionMinimum best{start.normalized(), value(start.normalized())};
  constexpr int kSides = 8;
  while (step_rad > least_rad) {
    const Eigen::Matrix3d axes = axes_along(best.direction);
    DirectionMinimum next = best;
    for (int side = 0; side < kSides; ++side) {
      const double turn = 2.0 * std::numbers::pi * side / kSides;
      const Eigen::Vector3d direction =
          (axes.col(2) + step_rad * (std::cos(turn) * axes.col(0) + std::sin(turn) * axes.col(1))).normalized();
      const double there = value(direction);
      if (there < next.value) next = {direction, there};
    }
    if (next.value < best.value) {
      best = next;
    } else {
      step_rad *= 0.5;
    }
  }
  return best;
}

}  // namespace crosstie::math::detail
