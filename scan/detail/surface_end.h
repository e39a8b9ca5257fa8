#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/phase_map.h"

namespace crosstie::scan::detail {

/// A pixel at which a surface that carries phases ends or bends, and the way out of it.
struct SurfaceEnd {
  int x = 0;
  int y = 0;
  Eigen::Vector2d out = Eigen::Vector2d::UnitX();  ///< unit; of a bend: towards the side that is seen flatter
  bool bend = false;                               ///< the phases go on beyond, with another slope
};

/// The ends of all surfaces in an image, row by row. An end: a pixel of a surface (phases that go on smoothly over most of its neighbours)
/// beside one of none. A bend: the place where the phases' slopes to both sides, averaged over a few pixels, differ most; they must differ by
/// eight sigmas and by a quarter of the median slope of the image.
std::vector<SurfaceEnd> surface_ends(const base::PhaseMap& map, int threads);

}  // namespace crosstie::scan::detail
