#pragma once

#include <array>
#include <cstddef>

namespace crosstie::math {

/// The normal distribution function and its density at one place.
struct EdgeProfile {
  double distribution, density;
};

/// Nodes of the tabulated normal distribution: t = k / kNodesPerUnit - kTableEnd.
inline constexpr int kTableEnd = 8;
inline constexpr int kNodesPerUnit = 64;
using EdgeTable = std::array<EdgeProfile, 2 * kTableEnd * kNodesPerUnit + 1>;
[[nodiscard]] const EdgeTable& edge_table();

/// Taylor's series of third order from the nearest node: error below 1e-9. Beyond +-8: 0 or 1.
[[nodiscard]] inline EdgeProfile edge_profile(double t) {
  static const EdgeTable& table = edge_table();
  if (!(t > -kTableEnd)) return {0.0, 0.0};
  if (!(t < kTableEnd)) return {1.0, 0.0};
  const auto k = static_cast<int>((t + kTableEnd) * kNodesPerUnit + 0.5);
  const double t0 = static_cast<double>(k) / kNodesPerUnit - kTableEnd;
  const double h = t - t0;
  const EdgeProfile& node = table[static_cast<std::size_t>(k)];
  const double curvature = (t0 * t0 - 1.0) * h * h;
  return {node.distribution + node.density * h * (1.0 - 0.5 * t0 * h + curvature / 6.0),
          node.density * (1.0 - t0 * h + 0.5 * curvature + t0 * (3.0 - t0 * t0) * h * h * h / 6.0)};
}

/// The distribution alone, linear between the nodes: error below 1e-5.
[[nodiscard]] inline double edge_distribution(double t) {
  static const EdgeTable& table = edge_table();
  if (!(t > -kTableEnd)) return 0.0;
  if (!(t < kTableEnd)) return 1.0;
  const double place = (t + kTableEnd) * kNodesPerUnit;
  const auto k = static_cast<int>(place);
  const double before = table[static_cast<std::size_t>(k)].distribution;
  return before + (place - k) * (table[static_cast<std::size_t>(k) + 1].distribution - before);
}

}  // namespace crosstie::math
