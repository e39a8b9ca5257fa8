#include "base/tool_path.h"

#include <fmt/core.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using nlohmann::ordered_json;

ordered_json triple(const Eigen::Vector3d& v) { return ordered_json::array({v.x(), v.y(), v.z()}); }

}  // namespace

std::string_view path_source_name(PathSource source) {
  switch (source) {
    case PathSource::kMeasured:
      return "measured";
    case PathSource::kBlend:
      return "blend";
    case PathSource::kNominal:
      return "nominal";
  }
  return "";
}

Eigen::Matrix3d ToolPathPoint::frame_from_tool() const {
  Eigen::Matrix3d axes;
  axes.col(2) = torch;
  axes.col(0) = (tangent - tangent.dot(torch) * torch).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

Result<> write_tool_path_json(const std::filesystem::path& path, const ToolPath& tool_path) {
  ordered_json json = {{"format", "crosstie-path/1"},
                       {"unit", "mm"},
                       {"frame", tool_path.frame},
                       {"closed", tool_path.closed},
                       {"length_mm", tool_path.length_mm},
                       {"duration_s", tool_path.duration_s},
                       {"bevel_rad", tool_path.bevel_rad},
                       {"lead_rad", tool_path.lead_rad},
                       {"standoff_mm", tool_path.standoff_mm},
                       {"offset_mm", tool_path.offset_mm}};
  json["gaps"] = ordered_json::array();
  for (const EdgeGap& gap : tool_path.gaps) {
    json["gaps"].push_back({{"from_mm", gap.from_mm}, {"length_mm", gap.length_mm}, {"reason", gap.reason}});
  }
  json["points"] = ordered_json::array();
  for (const ToolPathPoint& p : tool_path.points) {
    json["points"].push_back({{"s_mm", p.s_mm},
                              {"time_s", p.time_s},
                              {"xyz_mm", triple(p.point_mm)},
                              {"tangent", triple(p.tangent)},
                              {"normal", triple(p.normal)},
                              {"torch", triple(p.torch)},
                              {"speed_mm_per_s", p.speed_mm_per_s},
                              {"correction_uv_mm", {p.correction_u_mm, p.correction_v_mm}},
                              {"sigma_uv_mm", {p.sigma_u_mm, p.sigma_v_mm}},
                              {"sigma_torch_rad", {p.sigma_torch_rad.x(), p.sigma_torch_rad.y()}},
                              {"source", path_source_name(p.source)}});
  }
  return write_json(path, json);
}

Result<> write_tool_path_csv(const std::filesystem::path& path, const ToolPath& tool_path) {
  Table table;
  table.columns = {"s_mm",
                   "time_s",
                   "x_mm",
                   "y_mm",
                   "z_mm",
                   "tx",
                   "ty",
                   "tz",
                   "nx",
                   "ny",
                   "nz",
                   "torch_x",
                   "torch_y",
                   "torch_z",
                   "speed_mm_per_s",
                   "correction_u_mm",
                   "correction_v_mm",
                   "sigma_u_mm",
                   "sigma_v_mm",
                   "sigma_torch_u_rad",
                   "sigma_torch_t_rad",
                   "source"};
  for (const ToolPathPoint& p : tool_path.points) {
    std::vector<std::string> row = {format_double(p.s_mm), format_double(p.time_s)};
    for (const Eigen::Vector3d& v : {p.point_mm, p.tangent, p.normal, p.torch}) {
      for (const double value : v) row.push_back(format_double(value));
    }
    for (const double value : {p.speed_mm_per_s, p.correction_u_mm, p.correction_v_mm, p.sigma_u_mm, p.sigma_v_mm,
                               p.sigma_torch_rad.x(), p.sigma_torch_rad.y()}) {
      row.push_back(format_double(value));
    }
    row.emplace_back(path_source_name(p.source));
    table.rows.push_back(std::move(row));
  }
  return write_table(path, table);
}

}  // namespace crosstie::base
