#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/cloud.h"

namespace crosstie::base {

/// A surface of triangles in mm; their corners run counter-clockwise as seen from outside.
struct Mesh {
  Cloud vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< indices into vertices.points; empty: a cloud of points alone
};

}  // namespace crosstie::base
