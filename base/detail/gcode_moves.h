#pragma once

#include <string>
#include <vector>

#include "base/tool_path.h"

namespace crosstie::base::detail {

/// The torch's angles at a point, in degrees.
struct TorchAngles {
  double a_deg = 0.0;
  double b_deg = 0.0;
  double tilt_deg = 0.0;
  double azimuth_deg = 0.0;
};

/// Of every point; a and azimuth go on over 180 degrees without a jump.
[[nodiscard]] std::vector<TorchAngles> torch_angles(const ToolPath& path);

/// A move to point `to` of a path.
struct GcodeMove {
  std::size_t to = 0;
  std::string words;  ///< "G1 X.. Y.. Z.." or "G2 X.. Y.. Z.. I.. J.."
};

/// 17, 18 or 19: the plane that the surface's mean normal is nearest to being square to.
[[nodiscard]] int arc_plane(const ToolPath& path);

/// The moves after the first point. With a tolerance, the longest runs of points that one arc of the plane `plane` follows within it
/// (its third axis and the torch's angles in proportion to the angle), of up to half a turn.
[[nodiscard]] std::vector<GcodeMove> gcode_moves(const ToolPath& path, int plane, double arc_tolerance_mm);

/// Five decimals: a hundredth of a micrometre, so that an arc's two radii agree.
[[nodiscard]] std::string gcode_number(double value);

}  // namespace crosstie::base::detail
