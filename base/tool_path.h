#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/result.h"

namespace crosstie::base {

/// Where a point of a tool path comes from.
enum class PathSource {
  kMeasured,  ///< the nominal corrected by the measured rim
  kBlend,     ///< inside of a gap of the rim, where the correction fades out
  kNominal,   ///< inside of a gap: the nominal as it is placed
};

/// "measured", "blend", "nominal".
[[nodiscard]] std::string_view path_source_name(PathSource source);

/// A place of the torch. All directions have unit length.
struct ToolPathPoint {
  double s_mm = 0.0;                                   ///< along the path, from its first point
  double time_s = 0.0;                                 ///< since its first point
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< of the torch's tip
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();  ///< the way it goes, within the surface
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< of the surface, towards the head; across the tangent
  Eigen::Vector3d torch = Eigen::Vector3d::UnitZ();    ///< from the tip along the torch, away from the workpiece
  double speed_mm_per_s = 0.0;                         ///< on the way to this point
  /// Correction of the nominal: u into the opening (to the left of a counter-clockwise way), v along the normal.
  double correction_u_mm = 0.0;
  double correction_v_mm = 0.0;
  double sigma_u_mm = 0.0;  ///< of the path across itself in the surface, all parts together
  double sigma_v_mm = 0.0;  ///< along the normal
  /// Of the torch's direction, all parts together: its tilts towards u and along the way.
  Eigen::Vector2d sigma_torch_rad = Eigen::Vector2d::Zero();
  PathSource source = PathSource::kMeasured;

  /// Axes of the tool's frame in columns: z along the torch, x as near to the tangent as that allows, y = z x x.
  [[nodiscard]] Eigen::Matrix3d frame_from_tool() const;
};

/// The way of a torch round a hole.
struct ToolPath {
  std::string frame;    ///< of its points: "machine", or "rig" of a single station
  bool closed = false;  ///< the last point is in the place of the first
  std::vector<ToolPathPoint> points;
  double length_mm = 0.0;
  double duration_s = 0.0;
  double bevel_rad = 0.0;  ///< the torch leans over the opening by it
  double lead_rad = 0.0;   ///< and forward
  double standoff_mm = 0.0;
  double offset_mm = 0.0;     ///< into the opening
  std::vector<EdgeGap> gaps;  ///< stretches of the path, from_mm along it, on which the rim was not measured
  std::vector<Warning> warnings;
};

/// path.json (docs/formats.md), atomically.
Result<> write_tool_path_json(const std::filesystem::path& path, const ToolPath& tool_path);

/// Reads it back. Errors: kFileSystem; kBadInput with the file for another format or unit, missing members, directions without unit
/// length, values that are not finite, and less than two points.
Result<ToolPath> read_tool_path_json(const std::filesystem::path& path);

/// s_mm,time_s,x_mm,y_mm,z_mm,tx,ty,tz,nx,ny,nz,torch_x,torch_y,torch_z,speed_mm_per_s,correction_u_mm,correction_v_mm,sigma_u_mm,
/// sigma_v_mm,sigma_torch_u_rad,sigma_torch_t_rad,source; atomically.
Result<> write_tool_path_csv(const std::filesystem::path& path, const ToolPath& tool_path);

/// DXF of release 12 with $INSUNITS 4 (mm): the path as a 3D polyline on the layer PATH, its stretches without a measurement on the
/// layer GAPS, the torch axis about every fifty millimetres as a line of 20 mm on the layer TORCH. Atomically.
Result<> write_tool_path_dxf(const std::filesystem::path& path, const ToolPath& tool_path);

}  // namespace crosstie::base
