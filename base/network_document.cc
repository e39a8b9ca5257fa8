// The body of `adjust` in base/result_document.h.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/result_document.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;
using detail::upper_triangle_json;

Json camera_json(const AdjustedCamera& adjusted) {
  Json json = detail::lens_json(adjusted.name, adjusted.camera, adjusted.estimated);
  json["coverage"] = adjusted.coverage;
  json["significance_p"] = detail::significance_json(adjusted.significance_p);
  return json;
}

Json image_json(const AdjustedImage& image) {
  return {{"name", image.name},
          {"camera", image.camera},
          {"network_from_camera", detail::matrix_json(image.network_from_camera)},
          {"cov", upper_triangle_json(image.cov)},
          {"rms_px", image.rms_px},
          {"max_px", image.max_px},
          {"rays", image.rays},
          {"coverage", image.coverage}};
}

Json point_json(const AdjustedPoint& point) {
  return {{"id", point.id},
          {"kind", point.kind},
          {"xyz_mm", list_json(point.xyz_mm)},
          {"sigma_mm", list_json(Eigen::Vector3d(point.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt()))},
          {"cov_mm2", upper_triangle_json(point.cov_mm2)},
          {"rays", point.rays},
          {"angle_rad", point.angle_rad},
          {"rms_px", point.rms_px},
          {"max_px", point.max_px},
          {"max_w", point.max_w},
          {"least_redundancy", point.least_redundancy}};
}

Json rig_json(const AdjustedRig& rig) {
  Json mounts = Json::array();
  for (const AdjustedMount& mount : rig.mounts) {
    mounts.push_back({{"camera", mount.camera},
                      {"rig_from_camera", detail::matrix_json(mount.rig_from_camera)},
                      {"cov", upper_triangle_json(mount.cov)}});
  }
  return {{"name", rig.name},
          {"stations", rig.stations},
          {"baseline_mm", rig.baseline_mm()},
          {"baseline_sigma_mm", rig.baseline_sigma_mm()},
          {"mounts", std::move(mounts)}};
}

Json control_json(const AdjustedControl& point) {
  return {
      {"id", point.id}, {"residual_mm", list_json(point.residual_mm)}, {"sigma_mm", list_json(point.sigma_mm)}, {"w", point.w}};
}

Json scale_bar_json(const AdjustedScaleBar& adjusted) {
  const ScaleBar& bar = adjusted.bar;
  const char* role = bar.role == ScaleBarRole::kUsed ? "used" : bar.role == ScaleBarRole::kCheck ? "check" : "defines";
  return {{"a", bar.id_a},
          {"b", bar.id_b},
          {"length_mm", bar.length_mm},
          {"length_sigma_mm", bar.sigma_mm},
          {"length_at_temperature_mm", bar.length_at_temperature_mm()},
          {"temperature_c", bar.temperature_c},
          {"cte_per_k", bar.cte_per_k},
          {"measured_mm", adjusted.measured_mm},
          {"sigma_mm", adjusted.sigma_mm},
          {"w", adjusted.w},
          {"role", role},
          {"certificate", bar.certificate}};
}

/// An entry of "points" in an adjust result, or nothing where a key is missing or of the wrong kind.
std::optional<ReferencePoint> read_point(const Json& json) {
  const auto is_list = [&](const char* key, std::size_t size) {
    return json.contains(key) && json[key].is_array() && json[key].size() == size &&
           std::all_of(json[key].begin(), json[key].end(), [](const Json& v) { return v.is_number(); });
  };
  if (!json.is_object() || !json.contains("id") || !json["id"].is_number_integer() || !is_list("xyz_mm", 3) ||
      !is_list("cov_mm2", 6)) {
    return std::nullopt;
  }
  const auto id = json["id"].get<std::int64_t>();
  if (id < 0 || id > std::numeric_limits<int>::max()) return std::nullopt;
  ReferencePoint point;
  point.id = static_cast<int>(id);
  for (int i = 0; i < 3; ++i) point.xyz_mm[i] = json["xyz_mm"][static_cast<std::size_t>(i)].get<double>();
  Eigen::Matrix3d cov;
  std::size_t k = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) cov(i, j) = cov(j, i) = json["cov_mm2"][k++].get<double>();
  }
  point.cov_mm2 = cov;
  point.has_own_id = !(json.contains("kind") && json["kind"] == "uncoded");
  return point;
}

}  // namespace

Json network_json(const AdjustedNetwork& network) {
  Json json;
  json["datum"] = network.datum;
  json["scale"] = network.scale;
  json["sigma0"] = network.sigma0;
  json["sigma0_px"] = network.sigma0_px;
  json["rms_px"] = network.rms_px;
  json["observations"] = network.observations;
  json["unknowns"] = network.unknowns;
  json["conditions"] = network.conditions;
  json["redundancy"] = network.redundancy;
  json["chi2_p"] = network.chi2_p;
  const ObservationCounts& observed = network.observed;
  json["observed"] = {{"image_coordinates", observed.image_coordinates},
                      {"scale_bars", observed.scale_bars},
                      {"control_coordinates", observed.control_coordinates},
                      {"lens_parameters", observed.lens_parameters}};
  const UnknownCounts& estimated = network.estimated;
  json["estimated"] = {
      {"interior", estimated.interior}, {"exterior", estimated.exterior}, {"rig", estimated.rig}, {"object", estimated.object}};
  json["iterations"] = network.iterations;
  json["last_step"] = network.last_step;
  json["structural_rank"] = network.structural_rank;
  json["rank"] = network.rank;
  json["least_eigenvalue"] = network.least_eigenvalue;
  json["weakest"] = network.weakest;
  json["variance_components"] = {{"applied", network.variance_components_applied}, {"groups", Json::array()}};
  for (const VarianceComponent& of : network.variance_components) {
    Json group = {
        {"group", of.group}, {"observations", of.observations}, {"redundancy", of.redundancy}, {"estimated", of.estimated}};
    for (const auto& [key, value] : {std::pair{"sigma_ratio", of.sigma_ratio}, std::pair{"sigma_ratio_sigma", of.sigma},
                                     std::pair{"low", of.low}, std::pair{"high", of.high}, std::pair{"p", of.p}})
      group[key] = of.estimated ? Json(value) : Json(nullptr);
    json["variance_components"]["groups"].push_back(std::move(group));
  }
  for (const char* key : {"points", "images", "cameras", "rigs", "scale_bars", "control", "rejected"})
    json[key] = Json::array();
  for (const auto& point : network.points) json["points"].push_back(point_json(point));
  for (const auto& image : network.images) json["images"].push_back(image_json(image));
  for (const auto& camera : network.cameras) json["cameras"].push_back(camera_json(camera));
  for (const auto& rig : network.rigs) json["rigs"].push_back(rig_json(rig));
  for (const auto& bar : network.scale_bars) json["scale_bars"].push_back(scale_bar_json(bar));
  for (const auto& point : network.control) json["control"].push_back(control_json(point));
  for (const auto& r : network.rejected) {
    json["rejected"].push_back({{"image", r.image}, {"id", r.id}, {"reason", r.reason}, {"w", r.w}});
  }
  json["uncoded"] = {{"found", network.uncoded.found},
                     {"matched", network.uncoded.matched},
                     {"targets", network.uncoded.targets},
                     {"ambiguous", std::count_if(network.uncoded.left.begin(), network.uncoded.left.end(),
                                                 [](const UnmatchedDot& dot) { return dot.ambiguous; })}};
  return json;
}

Result<PointList> points_from_network_json(const std::filesystem::path& result_json) {
  auto json = read_json(result_json);
  if (!json) return fail(std::move(json));
  const auto bad = [&](std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(result_json), what));
  };
  const auto is = [&](const char* key, std::string_view value) { return json->contains(key) && (*json)[key] == value; };
  if (!json->is_object() || !is("format", detail::kResultFormat))
    return bad("no result of crosstie (format crosstie-result/1)");
  if (!is("verb", "adjust")) return bad("not the result of adjust");
  if (!is("unit", "mm")) return bad("its unit is not mm");
  if (!json->contains("points") || !(*json)["points"].is_array()) return bad("no list of points");
  PointList list;
  for (const Json& entry : (*json)["points"]) {
    auto point = read_point(entry);
    if (!point) return bad(fmt::format("point {} of the list cannot be read", list.points.size() + 1));
    list.points.push_back(*std::move(point));
  }
  std::stable_sort(list.points.begin(), list.points.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  for (std::size_t i = 1; i < list.points.size(); ++i) {
    if (list.points[i].id == list.points[i - 1].id) return bad(fmt::format("point {} occurs twice", list.points[i].id));
  }
  return list;
}

Result<> write_residuals(const std::filesystem::path& path, const AdjustedNetwork& network) {
  Table table;
  table.path = path;
  table.columns = {"image",      "id",           "x_px",         "y_px", "residual_x_px", "residual_y_px", "sigma_x_px",
                   "sigma_y_px", "redundancy_x", "redundancy_y", "w"};
  for (const AdjustedObservation& o : network.residuals) {
    std::vector<std::string> row = {network.images[static_cast<std::size_t>(o.image)].name,
                                    std::to_string(network.points[static_cast<std::size_t>(o.point)].id)};
    for (const Eigen::Vector2d& pair : {o.measured_px, o.residual_px, o.sigma_px, o.redundancy}) {
      row.push_back(format_double(pair.x()));
      row.push_back(format_double(pair.y()));
    }
    row.push_back(format_double(o.w));
    table.rows.push_back(std::move(row));
  }
  return write_table(path, table);
}

}  // namespace crosstie::base
