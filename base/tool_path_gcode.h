#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/tool_path.h"

namespace crosstie::base {

struct GcodeOptions {
  std::string program = "crosstie";  ///< a name for the program's comment
  /// Text with placeholders in braces; the default is default_gcode_template().
  std::string template_text = {};
  double retract_mm = 50.0;  ///< the torch comes and goes along its axis from so far
  /// Runs of points are joined to arcs (G2, G3) as long as every point stays within this; 0: straight moves (G1) alone.
  double arc_tolerance_mm = 0.0;
};

/// The template that is used where none is given: X Y Z and the torch's angles A and B, mm, feed per minute.
[[nodiscard]] std::string_view default_gcode_template();

/// The program for a path (RS-274/NGC, as LinuxCNC reads it).
///
/// Placeholders. Of the whole: {program} {frame} {count} {length_mm} {duration_s} {plane} (G17, G18 or G19: the plane of the arcs, the one
/// nearest to the hole's). Of a point: {x} {y} {z} mm; {approach_x} {approach_y} {approach_z}, the same retracted along the torch;
/// {torch_x} {torch_y} {torch_z} and {nx} {ny} {nz}, directions of the torch and the surface's normal; {a_deg} {b_deg} with
/// torch = Rx(a) Ry(b) e_z; {tilt_deg} from z and {azimuth_deg} from x about z; {feed} mm/min; {s_mm}; {source}; {n}, its number.
/// The lines between `{begin points}` and `{end points}`, each alone on its line, are repeated for every move after the first point;
/// there {motion} is the move itself, G1 X Y Z or an arc. Before them a point's placeholders are the first point's, after them the
/// last one's. `{{` is a brace.
///
/// Errors: kBadInput, with the template's line, for an unknown placeholder, a brace that is not closed, a block that is missing,
/// repeated or left open, a template without G21 or with G20 outside of its comments: the unit is always stated, and it is mm;
/// kUsage for options out of their domain.
Result<std::string> gcode_of(const ToolPath& path, const GcodeOptions& options = {});

/// The same into a file, atomically.
Result<> write_gcode(const std::filesystem::path& path, const ToolPath& tool_path, const GcodeOptions& options = {});

}  // namespace crosstie::base
