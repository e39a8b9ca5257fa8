// The bodies of `commission` and of its check in base/result_document.h.
#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/detail/adjustment_json.h"
#include "base/detail/result_json.h"
#include "base/detail/result_reading.h"
#include "base/result_document.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;
using detail::matrix_json;
using detail::upper_triangle_json;

/// All terms of one error motion: `coefficients` are those of the axis, 0 where a term takes no part (it is not in `axis_orders`);
/// `found` is what its test saw.
Json motion_json(const LinearAxis& axis, const std::string& name) {
  Json json = {{"name", name}, {"unit", "mm"}, {"significant", false}};
  for (const char* key : {"orders", "coefficients", "found", "sigmas", "p", "significant_orders", "axis_orders"})
    json[key] = Json::array();
  for (const ErrorMotion& term : axis.terms) {
    if (term.name != name) continue;
    if (term.angle) json["unit"] = "rad";
    json["orders"].push_back(term.order);
    json["coefficients"].push_back(term.in_frame ? term.value : 0.0);
    json["found"].push_back(term.coefficient);
    json["sigmas"].push_back(term.sigma);
    json["p"].push_back(term.p);
    if (term.in_frame) json["axis_orders"].push_back(term.order);
    if (!term.significant) continue;
    json["significant"] = true;
    json["significant_orders"].push_back(term.order);
  }
  return json;
}

Json axis_json(const LinearAxis& axis) {
  Json json = {{"direction_in_machine", list_json(axis.direction_in_machine)},
               {"direction_cov", upper_triangle_json(axis.direction_cov)},
               {"scale_ppm", axis.scale_ppm},
               {"scale_sigma_ppm", axis.scale_sigma_ppm},
               {"scale_p", axis.scale_p},
               {"scale_significant", axis.scale_significant},
               {"level", axis.level},
               {"from_mm", axis.from_mm},
               {"to_mm", axis.to_mm},
               {"pivot_mm", list_json(axis.pivot_mm)},
               {"stop_sigma_mm", axis.stop_sigma_mm},
               {"stop_sigma_rad", axis.stop_sigma_rad},
               {"reading_sigma_mm", axis.reading_sigma_mm}};
  json["terms"] = Json::array();
  std::vector<std::string> names;
  for (const ErrorMotion& term : axis.terms) {
    if (std::find(names.begin(), names.end(), term.name) == names.end()) names.push_back(term.name);
  }
  for (const std::string& name : names) json["terms"].push_back(motion_json(axis, name));
  return json;
}

/// What MachineFrame::at() needs beside the axis; `cov` is joint of pose, direction, scale and the terms that take part.
Json frame_json(const MachineFrame& frame) {
  Json across = Json::array();
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 2; ++k) across.push_back(frame.across(i, k));
  }
  std::vector<std::string> terms;
  for (const ErrorMotion& term : frame.axis.terms) {
    if (term.in_frame) terms.push_back(term.name + " " + std::to_string(term.order));
  }
  return {{"middle_mm", frame.axis.middle_mm()},
          {"machine_from_rig_at_middle", matrix_json(frame.machine_from_rig_at_middle)},
          {"across", std::move(across)},
          {"terms", std::move(terms)},
          {"cov", upper_triangle_json(frame.cov)}};
}

Json sphere_json(const CommissionedSphere& sphere) {
  return {{"id", sphere.id},
          {"centre_mm", list_json(sphere.centre_mm)},
          {"cov_mm2", upper_triangle_json(sphere.cov_mm2)},
          {"residual_mm", list_json(sphere.residual_mm)},
          {"sigma_mm", list_json(sphere.sigma_mm)},
          {"w", sphere.w},
          {"left_out_mm", sphere.left_out_mm ? list_json(*sphere.left_out_mm) : Json(nullptr)},
          {"left_out_sigma_mm", sphere.left_out_mm ? list_json(sphere.left_out_sigma_mm) : Json(nullptr)}};
}

Json station_json(const CommissionedStation& station) {
  return {{"name", station.name},
          {"axis_mm", station.axis_mm},
          {"machine_from_rig", matrix_json(station.machine_from_rig)},
          {"cov", upper_triangle_json(station.cov)},
          {"off_axis", list_json(station.off_axis)},
          {"off_along_mm", station.off_along_mm},
          {"w", station.w}};
}

Json head_json(const Head& head) {
  const int left = parameter_count(head.left.model());
  const int right = parameter_count(head.right.model());
  const auto with_cov = [&](Camera camera, int first, int count) {
    if (head.cov.size() > 0) camera.set_covariance(head.cov.block(first, first, count, count));
    return camera;
  };
  return {detail::lens_json(head.left_name, with_cov(head.left, 0, left), true),
          detail::lens_json(head.right_name, with_cov(head.right, left, right), true)};
}

Json rejected_json(const std::vector<Commissioning::Rejected>& rejected) {
  Json json = Json::array();
  for (const Commissioning::Rejected& one : rejected) {
    json.push_back({{"subject", one.subject}, {"id", one.id}, {"reason", one.reason}, {"w", one.w}});
  }
  return json;
}

}  // namespace

Json commissioning_json(const Commissioning& result) {
  const Head& head = result.head;
  Json json;
  json["cameras"] = head_json(head);
  json["rig"] = {{"left", head.left_name},
                 {"right", head.right_name},
                 {"right_from_left", matrix_json(head.right_from_left)},
                 {"cov", head.cov.size() > 0 ? upper_triangle_json(head.cov.bottomRightCorner<6, 6>()) : Json(nullptr)},
                 {"baseline_mm", result.baseline_mm},
                 {"baseline_sigma_mm", result.baseline_sigma_mm},
                 {"temperature_c", head.temperature_c ? Json(*head.temperature_c) : Json(nullptr)}};
  json["axis"] = axis_json(result.frame.axis);
  json["machine_from_rig_at_zero"] = matrix_json(result.machine_from_rig_at_zero.machine_from_rig);
  json["cov"] = upper_triangle_json(result.machine_from_rig_at_zero.cov);
  json["zero_in_travel"] = result.zero_in_travel;
  json["frame_at_middle"] = frame_json(result.frame);
  json["machine_from_cross"] = matrix_json(result.machine_from_cross);
  json["machine_from_cross_cov"] = upper_triangle_json(result.machine_from_cross_cov);
  json["growth_ppm"] = result.growth_ppm;
  json["growth_sigma_ppm"] = result.growth_sigma_ppm;
  json["growth_stated_ppm"] = result.growth_stated_ppm;
  json["growth_stated_sigma_ppm"] = result.growth_stated_sigma_ppm;
  json["datum"] = result.datum;
  json["fre_mm"] = result.fre_mm;
  json["sphere_scale_ppm"] = result.sphere_scale_ppm;
  json["sphere_scale_sigma_ppm"] = result.sphere_scale_sigma_ppm;
  for (const char* key : {"spheres", "checked_at", "stations", "images", "markers", "tre", "groups"}) json[key] = Json::array();
  for (const auto& sphere : result.spheres) json["spheres"].push_back(sphere_json(sphere));
  for (const auto& pose : result.checked_at) json["checked_at"].push_back(detail::head_pose_json(pose));
  for (const auto& station : result.stations) json["stations"].push_back(station_json(station));
  for (const auto& image : result.images) {
    json["images"].push_back({{"name", image.name},
                              {"camera", image.camera},
                              {"station", result.stations.at(static_cast<std::size_t>(image.station)).name},
                              {"rays", image.rays},
                              {"rms_px", image.rms_px},
                              {"max_px", image.max_px}});
  }
  for (const auto& marker : result.markers) {
    json["markers"].push_back({{"id", marker.id},
                               {"rays", marker.rays},
                               {"xyz_mm", list_json(marker.xyz_mm)},
                               {"residual_mm", list_json(marker.residual_mm)},
                               {"sigma_mm", list_json(marker.sigma_mm)}});
  }
  for (const auto& point : result.tre) {
    json["tre"].push_back({{"axis_mm", point.axis_mm},
                           {"p_in_rig_mm", list_json(point.p_in_rig_mm)},
                           {"p_in_machine_mm", list_json(point.p_in_machine_mm)},
                           {"cov_mm2", upper_triangle_json(point.cov_mm2)}});
  }
  for (const auto& group : result.groups) {
    json["groups"].push_back(
        {{"name", group.name}, {"observations", group.observations}, {"redundancy", group.redundancy}, {"ratio", group.ratio}});
  }
  json["rejected"] = rejected_json(result.rejected);
  detail::add_figures(result, json);
  json["image_sigma_factor"] = result.image_sigma_factor;
  json["largest_eccentricity_px"] = result.largest_eccentricity_px;
  json["chi2_p"] = result.chi2_p;
  return json;
}

Json head_check_json(const HeadCheck& check) {
  Json json = {{"axis_mm", check.axis_mm},
               {"verdict", std::string(verdict_name(check.verdict))},
               {"message", check.message},
               {"level", check.level},
               {"common_markers", check.common_markers},
               {"cross_markers", check.cross_markers},
               {"epipolar_rms_px", check.epipolar_rms_px},
               {"rms_px", check.rms_px},
               {"rig_change", list_json(check.rig_change)},
               {"rig_change_sigma", list_json(check.rig_change_sigma)},
               {"rig_seen", check.rig_seen},
               {"head_change", list_json(check.head_change)},
               {"head_change_sigma", list_json(check.head_change_sigma)}};
  json["tests"] = Json::array();
  for (const HeadCheck::Test& test : check.tests) {
    json["tests"].push_back({{"name", test.name},
                             {"unit", test.unit},
                             {"value", test.value},
                             {"sigma", test.sigma},
                             {"statistic", test.statistic},
                             {"dof", test.dof},
                             {"p", test.p},
                             {"accused", test.accused}});
  }
  json["rejected"] = rejected_json(check.rejected);
  return json;
}

}  // namespace crosstie::base
