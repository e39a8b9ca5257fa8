#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace crosstie::edge::detail {

/// An edge as it lies in a plane: where, and the way from the material to where it ends.
struct FlatEdge {
  Eigen::Vector2d at_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d out = Eigen::Vector2d::UnitX();  ///< unit
};

/// An opening that is seen whole from its middle: whichever way one looks from there, the first edge is its rim.
struct Opening {
  Eigen::Vector2d middle_mm = Eigen::Vector2d::Zero();
  double support =
      0.0;  ///< share of the directions whose first edge has its material beyond and lies as far as its neighbours': 1 of a closed rim
  std::vector<std::size_t> rim;  ///< indices of these first edges, one for each direction that has one
};

/// The best supported openings, at most `most`, none of which lies in another: middles are tried over all that the edges span, those that count are
/// moved to the middle between the edges of opposite directions.
[[nodiscard]] std::vector<Opening> find_openings(const std::vector<FlatEdge>& edges, std::size_t most);

/// The edges of an opening's rim, `slack_mm` before or beyond its first edges, by index; material lies beyond them.
[[nodiscard]] std::vector<std::size_t> rim_edges(const std::vector<FlatEdge>& edges, const Opening& opening, double slack_mm);

}  // namespace crosstie::edge::detail
