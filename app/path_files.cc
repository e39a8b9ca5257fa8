#include "app/path_files.h"

#include <fmt/core.h>

#include "base/file.h"
#include "base/tool_path_gcode.h"

namespace crosstie::app {

using base::Result;

edge::ToolPathOptions path_options(const JobPath& path, const std::string& frame) {
  edge::ToolPathOptions options;
  options.step_mm = path.step_mm;
  options.cutoff_mm = path.cutoff_mm;
  options.tilt_cutoff_mm = path.tilt_cutoff_mm;
  options.max_correction_mm = path.max_correction_mm;
  options.max_slope = path.max_slope;
  options.max_gap_mm = path.max_gap_mm;
  options.blend_mm = path.blend_mm;
  options.counter_clockwise = path.counter_clockwise;
  options.start_mm = path.start_mm;
  options.bevel_rad = path.bevel_rad;
  options.lead_rad = path.lead_rad;
  options.standoff_mm = path.standoff_mm;
  options.offset_mm = path.offset_mm;
  options.speed_mm_per_s = path.speed_mm_per_s;
  options.max_turn_rad_per_s = path.max_turn_rad_per_s;
  options.retract_mm = path.retract_mm;
  if (frame == "machine" && path.reach_low_mm && path.reach_high_mm)
    options.reach = edge::Reach{*path.reach_low_mm, *path.reach_high_mm};
  return options;
}

Result<> write_path_files(const std::filesystem::path& folder, const base::ToolPath& tool_path, const JobPath& path,
                          const std::filesystem::path& template_file, const std::string& program) {
  base::GcodeOptions options;
  options.program = program;
  options.retract_mm = path.retract_mm;
  options.arc_tolerance_mm = path.arc_tolerance_mm;
  if (!template_file.empty()) {
    constexpr std::size_t kMostBytes = std::size_t{1} << 20;
    auto text = base::read_file(template_file, kMostBytes);
    if (!text) return base::fail(std::move(text));
    options.template_text = *std::move(text);
    if (options.template_text.empty()) {
      return base::fail(base::ErrorCode::kBadInput, fmt::format("{} is empty", base::shown(template_file)));
    }
  }
  // The program first: its template is the user's and may be wrong.
  if (auto written = base::write_gcode(folder / "path.ngc", tool_path, options); !written) {
    if (template_file.empty()) return written;
    return base::fail(written.error().code, fmt::format("{}: {}", base::shown(template_file), written.error().message));
  }
  if (auto written = base::write_tool_path_json(folder / "path.json", tool_path); !written) return written;
  if (auto written = base::write_tool_path_csv(folder / "path.csv", tool_path); !written) return written;
  return base::write_tool_path_dxf(folder / "path.dxf", tool_path);
}

}  // namespace crosstie::app
