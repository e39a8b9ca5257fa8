#include "app/live/job_scene.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <set>

#include <nlohmann/json.hpp>

#include "base/base64.h"
#include "base/json_file.h"
#include "base/ply.h"
#include "base/table.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::ordered_json;

/// Three little-endian floats a point.
std::string packed(const ScenePatch& patch, const base::Pose& frame_from_rig) {
  static_assert(std::endian::native == std::endian::little);
  std::string bytes;
  bytes.reserve(patch.p_in_rig_mm.size() * 3 * sizeof(float));
  for (const Eigen::Vector3d& p : patch.p_in_rig_mm) {
    const Eigen::Vector3f at = (frame_from_rig * p).cast<float>();
    bytes.append(reinterpret_cast<const char*>(at.data()), 3 * sizeof(float));
  }
  return bytes;
}

ordered_json triple(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

/// How the points of an edge hang together.
struct RimOrder {
  std::set<double> gap_begins_mm;  ///< arc lengths
  bool closed = false;
};

RimOrder rim_order(const fs::path& edge_result) {
  RimOrder order;
  const auto json = base::read_json(edge_result / "result.json");
  if (!json || !json->is_object()) return order;
  order.closed = json->value("closed", ordered_json(false)) == ordered_json(true);
  for (const ordered_json& gap : json->value("gaps", ordered_json::array())) {
    if (gap.is_object() && gap.contains("from_mm") && gap["from_mm"].is_number())
      order.gap_begins_mm.insert(gap["from_mm"].get<double>());
  }
  return order;
}

}  // namespace

Result<ScenePatch> read_patch(const fs::path& scan_result, const std::string& station, double axis_mm) {
  const auto cloud = base::read_ply(scan_result / "cloud.ply");
  if (!cloud) return tl::unexpected(cloud.error());
  ScenePatch patch{station, axis_mm, {}};
  const std::size_t step = std::max<std::size_t>(1, (cloud->points.size() + kPatchPoints - 1) / kPatchPoints);
  for (std::size_t i = 0; i < cloud->points.size(); i += step) patch.p_in_rig_mm.push_back(cloud->points[i]);
  return patch;
}

std::vector<RimPiece> read_rim(const fs::path& edge_result) {
  const auto table = base::read_table(edge_result / "edge.csv");
  if (!table || table->rows.empty()) return {};
  std::array<std::size_t, 4> columns{};
  for (std::size_t i = 0; const char* name : {"s_mm", "x_mm", "y_mm", "z_mm"}) {
    const auto column = table->column(name);
    if (!column) return {};
    columns[i++] = *column;
  }
  const RimOrder order = rim_order(edge_result);
  const auto gap_begins_at = [&](double s_mm) {
    constexpr double kSame_mm = 1e-6;
    const auto near = order.gap_begins_mm.lower_bound(s_mm - kSame_mm);
    return near != order.gap_begins_mm.end() && *near <= s_mm + kSame_mm;
  };
  std::vector<RimPiece> pieces(1);
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    std::array<double, 4> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto value = table->number(row, columns[i]);
      if (!value) return {};
      values[i] = *value;
    }
    const Eigen::Vector3d p(values[1], values[2], values[3]);
    if (pieces.back().gap) {
      pieces.back().p_in_machine_mm.push_back(p);
      pieces.emplace_back();
    }
    pieces.back().p_in_machine_mm.push_back(p);
    if (gap_begins_at(values[0])) pieces.push_back({{p}, true});
  }
  if (order.closed || pieces.back().gap) pieces.back().p_in_machine_mm.push_back(pieces.front().p_in_machine_mm.front());
  return pieces;
}

std::string scene_json(const LiveScene& scene) {
  ordered_json json = {{"version", scene.version}, {"frame", scene.frame}, {"unit", "mm"}};
  json["markers"] = ordered_json::array();
  for (const MarkerStatus& marker : scene.markers) {
    if (!marker.xyz_mm) continue;
    json["markers"].push_back({{"id", marker.id},
                               {"xyz_mm", triple(*marker.xyz_mm)},
                               {"sigma_mm", marker.sigma_mm ? ordered_json(marker.sigma_mm->norm()) : ordered_json(nullptr)},
                               {"live", true}});
  }
  json["patches"] = ordered_json::array();
  for (std::size_t i = 0; i < scene.patches.size(); ++i) {
    const auto& [patch, frame_from_rig] = scene.patches[i];
    json["patches"].push_back(
        {{"station", patch->station}, {"colour", i}, {"points", base::base64(packed(*patch, frame_from_rig))}});
  }
  json["rim"] = ordered_json::array();
  for (const RimPiece& piece : scene.rim) {
    ordered_json points = ordered_json::array();
    for (const Eigen::Vector3d& p : piece.p_in_machine_mm) points.push_back(triple(p));
    json["rim"].push_back({{"xyz_mm", points}, {"gap", piece.gap}});
  }
  json["head"] = nullptr;
  if (scene.frame_from_head) {
    const Eigen::Matrix4d m = scene.frame_from_head->matrix();
    ordered_json axes = ordered_json::array();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) axes.push_back(m(i, j));
    }
    json["head"] = {{"position_mm", {m(0, 3), m(1, 3), m(2, 3)}}, {"axes", axes}};
  }
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace crosstie::app
