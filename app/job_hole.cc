// [hole], [part] and [path]: what is cut, where it lies, and how

#include <cmath>

#include <fmt/core.h>

#include "app/job_sections.h"
#include "edge/nominal.h"

namespace crosstie::app {
namespace {

void direction(const JobTable& table, const char* key, std::optional<Eigen::Vector3d>& value) {
  table.triple(key, value);
  if (value && !(value->norm() > 1e-9)) table.complain(key, fmt::format("{} has no direction", key));
}

void angle(const JobTable& table, const char* key, double& value, double most_rad) {
  table.number(key, value, Domain::kAny);
  if (!(std::abs(value) <= most_rad)) {
    table.complain(key, fmt::format("{} is {} rad; up to {} is possible (radians, not degrees)", key, value, most_rad));
  }
}

}  // namespace

void read_hole(const JobTable& root, Job& job) {
  const auto table = root.table("hole");
  if (!table) return;
  table->check_keys("hole", {"nominal", "nominal_frame", "nominal_unit", "closed", "interpolation", "diameter_mm", "length_mm",
                             "width_mm", "exponent", "centre_mm", "normal", "length_direction", "markers", "markers_frame"});
  JobHole hole;
  table->text("nominal", hole.nominal);
  table->word("nominal_frame", {"part", "machine"}, hole.nominal_frame);
  table->text("nominal_unit", hole.unit);
  table->flag("closed", hole.closed);
  std::string interpolation = "spline";
  table->word("interpolation", {"spline", "lines"}, interpolation);
  hole.spline = interpolation == "spline";
  table->number("diameter_mm", hole.diameter_mm);
  table->number("length_mm", hole.length_mm);
  table->number("width_mm", hole.width_mm);
  table->number("exponent", hole.exponent);
  table->triple("centre_mm", hole.centre_mm);
  direction(*table, "normal", hole.normal);
  direction(*table, "length_direction", hole.direction);
  table->path("markers", hole.markers);
  std::string frame = "part";
  table->word("markers_frame", {"part", "machine"}, frame);
  hole.markers_in_part = frame == "part";
  if (table->has("markers_frame") && !hole.markers) table->complain("markers_frame", "markers_frame goes with markers");
  if (!edge::outline_of(hole.nominal)) {
    for (const char* key : {"diameter_mm", "length_mm", "width_mm", "exponent", "centre_mm", "normal", "length_direction"}) {
      if (table->has(key))
        table->complain(
            key, fmt::format("{} belongs to an outline: nominal = \"circle\", \"ellipse\", \"oval\" or \"superellipse\"", key));
    }
  }
  if (hole.nominal == "circle" && (hole.length_mm || hole.width_mm)) table->complain("length_mm", "a circle has diameter_mm");
  if (hole.nominal != "circle" && hole.diameter_mm)
    table->complain("diameter_mm", "only a circle has a diameter; length_mm and width_mm");
  if (hole.length_mm.has_value() != hole.width_mm.has_value()) table->complain("", "[hole] length_mm and width_mm go together");
  if (hole.centre_mm.has_value() != hole.normal.has_value()) table->complain("", "[hole] centre_mm and normal go together");
  if (hole.direction && !hole.centre_mm) table->complain("length_direction", "length_direction needs centre_mm and normal");
  job.hole = std::move(hole);
}

void read_part(const JobTable& root, Job& job) {
  const auto table = root.table("part");
  if (!table) return;
  table->check_keys("part", {"position", "points", "measured", "axis_point_mm", "axis_direction", "axis_in_machine",
                             "radius_mm", "half_angle_rad", "head"});
  JobPart& part = job.part;
  table->word("position", {"none", "markers", "rps", "tower"}, part.position);
  table->path("points", part.points);
  table->path("measured", part.measured);
  table->triple("axis_point_mm", part.axis_point_mm);
  direction(*table, "axis_direction", part.axis_direction);
  direction(*table, "axis_in_machine", part.axis_in_machine);
  table->number("radius_mm", part.radius_mm);
  angle(*table, "half_angle_rad", part.half_angle_rad, 0.5);
  std::string head = "outside";
  table->word("head", {"outside", "inside"}, head);
  part.seen_from_inside = head == "inside";
  if (part.axis_point_mm.has_value() != part.axis_direction.has_value()) {
    table->complain("", "[part] axis_point_mm and axis_direction go together");
  }
  if (part.radius_mm && !part.axis_point_mm) table->complain("radius_mm", "radius_mm needs axis_point_mm and axis_direction");
  if (part.position == "tower" && !part.axis_point_mm) {
    table->complain("position", "position = \"tower\" needs the tower's axis: axis_point_mm and axis_direction");
  }
  if (part.position == "tower" && !part.axis_in_machine && part.half_angle_rad == 0.0) {
    table->complain("position",
                    "which end of a cylinder is which nobody can see: position = \"tower\" needs axis_in_machine, about where "
                    "axis_direction points to in the machine");
  }
  const bool tied_by_stitch = part.position == "markers" && job.hole && job.hole->markers && job.hole->markers_in_part;
  if ((part.position == "markers" || part.position == "rps") && !part.points && !tied_by_stitch) {
    table->complain("position",
                    fmt::format("position = \"{}\" needs points, a list of the part's known points{}", part.position,
                                part.position == "markers" ? ", or [hole] markers in the part's frame" : ""));
  }
  if (part.position == "rps" && !part.measured) {
    table->complain("position", "position = \"rps\" needs measured, a list of the same points as the machine probed them");
  }
}

void read_path(const JobTable& root, Job& job) {
  const auto table = root.table("path");
  if (!table) return;
  table->check_keys("path", {"step_mm",      "cutoff_mm",     "tilt_cutoff_mm", "max_correction_mm", "max_slope",
                             "max_gap_mm",   "blend_mm",      "direction",      "start_mm",          "bevel_rad",
                             "lead_rad",     "standoff_mm",   "offset_mm",      "speed_mm_per_s",    "max_turn_rad_per_s",
                             "reach_low_mm", "reach_high_mm", "retract_mm",     "gcode_template",    "arc_tolerance_mm"});
  JobPath& path = job.path;
  table->number("step_mm", path.step_mm);
  table->number("cutoff_mm", path.cutoff_mm);
  table->number("tilt_cutoff_mm", path.tilt_cutoff_mm);
  table->number("max_correction_mm", path.max_correction_mm);
  table->number("max_slope", path.max_slope);
  table->number("max_gap_mm", path.max_gap_mm, Domain::kNotNegative);
  table->number("blend_mm", path.blend_mm);
  std::string way = "ccw";
  table->word("direction", {"ccw", "cw"}, way);
  path.counter_clockwise = way == "ccw";
  table->number("start_mm", path.start_mm, Domain::kAny);
  constexpr double kMostLean_rad = 1.2;
  angle(*table, "bevel_rad", path.bevel_rad, kMostLean_rad);
  angle(*table, "lead_rad", path.lead_rad, kMostLean_rad);
  table->number("standoff_mm", path.standoff_mm, Domain::kAny);
  table->number("offset_mm", path.offset_mm, Domain::kAny);
  table->number("speed_mm_per_s", path.speed_mm_per_s);
  table->number("max_turn_rad_per_s", path.max_turn_rad_per_s);
  table->triple("reach_low_mm", path.reach_low_mm);
  table->triple("reach_high_mm", path.reach_high_mm);
  table->number("retract_mm", path.retract_mm, Domain::kNotNegative);
  table->path("gcode_template", path.gcode_template);
  table->number("arc_tolerance_mm", path.arc_tolerance_mm, Domain::kNotNegative);
  if (path.reach_low_mm.has_value() != path.reach_high_mm.has_value()) {
    table->complain("", "[path] reach_low_mm and reach_high_mm go together");
  } else if (path.reach_low_mm && !((*path.reach_high_mm - *path.reach_low_mm).minCoeff() > 0.0)) {
    table->complain("reach_high_mm", "the reach is a box: reach_low_mm below reach_high_mm on every axis");
  }
}

}  // namespace crosstie::app
