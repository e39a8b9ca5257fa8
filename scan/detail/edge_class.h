#pragma once

#include <optional>
#include <vector>

#include "base/edge_pixels.h"
#include "base/phase_map.h"
#include "scan/detail/edge_piece.h"

namespace crosstie::scan::detail {

/// What an edge is. Phases in front of it (`frame`'s origin lies on it, `out` leads away from the material) are continued as a plane over the
/// image and held against those beyond, from `beyond_px` on. Nothing: no surface in front of it, or the edge belongs to the nearer
/// surface beyond. `depth_mm`: of each pixel, may be null.
std::optional<base::EdgeClass> classify_edge(const base::PhaseMap& map, const std::vector<float>* depth_mm,
                                             const EdgeImages& images, const PieceFrame& frame, double beyond_px);

/// Whether the phases in front of an edge end or leave their continuation directly beyond it, from `beyond_px` on: behind an edge of paint
/// that lies a few pixels before the end of its surface they go on as far as that.
bool ends_here(const base::PhaseMap& map, const EdgeImages& images, const PieceFrame& frame, double beyond_px);

/// How steeply the depth changes along `out` before and beyond the origin [mm/px]; nothing where depths are missing.
struct DepthSlopes {
  double before = 0.0;
  double beyond = 0.0;
};
std::optional<DepthSlopes> depth_slopes(const std::vector<float>& depth_mm, const EdgeImages& images, const PieceFrame& frame);

}  // namespace crosstie::scan::detail
