#pragma once

#include <vector>

#include <Eigen/Core>

#include "bundle/detail/dots.h"
#include "bundle/detail/views.h"

namespace crosstie::bundle::detail {

/// Where an uncoded target can be: a sphere about the coded points, twice as large as they reach.
struct Region {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< in network
  double radius_mm = 0.0;
};

/// A dot near an epipolar curve, and how far away the seed's target is if that dot is its other image.
struct Crossing {
  int dot = 0;
  double distance_mm = 0.0;  ///< from the seed's projection centre
};

/// The dots without id of one image that lie near the epipolar curve of `seed`: the image of its ray inside of `region`, bent by
/// the lens as it is, followed in chords short enough to be straight. What is near is generous (the sum of both dots' largest
/// sigmas, several times); the exact test is that of the two rays' common point. Sorted by the index of the dot.
std::vector<Crossing> crossings(const View& from, const Dot& seed, const View& to, const DotGrid& grid,
                                const std::vector<Dot>& dots, const Region& region);

}  // namespace crosstie::bundle::detail
