#include "base/acceptance_document.h"

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;
using detail::upper_triangle_json;

Json value_json(const AcceptanceValue& value) {
  return {{"value_mm", value.value_mm},
          {"sigma_mm", value.sigma_mm()},
          {"noise_sigma_mm", value.noise_sigma_mm},
          {"artefact_sigma_mm", value.artefact_sigma_mm}};
}

Json figures_json(const FormFigures& figures) {
  return {{"count", figures.count},
          {"discarded", figures.discarded},
          {"beyond_cap", figures.beyond_cap},
          {"rms_mm", figures.rms_mm},
          {"point_sigma_mm", figures.point_sigma_mm},
          {"predicted_mm", figures.predicted_mm},
          {"independent_share", figures.independent_share},
          {"correlation_mm", figures.correlation_mm}};
}

Json sphere_json(const MeasuredSphere& sphere) {
  Json json = {{"name", sphere.name},
               {"centre_mm", list_json(sphere.centre_mm)},
               {"cov_mm2", upper_triangle_json(sphere.cov_mm2)},
               {"diameter_mm", sphere.diameter_mm},
               {"diameter_sigma_mm", sphere.diameter_sigma_mm},
               {"held_centre_mm", list_json(sphere.held_centre_mm)},
               {"held_cov_mm2", upper_triangle_json(sphere.held_cov_mm2)},
               {"cap_rad", sphere.cap_rad},
               {"size_bias_mm", sphere.size_bias_mm}};
  json.update(figures_json(sphere.form_figures));
  json["form"] = value_json(sphere.form);
  json["size"] = value_json(sphere.size);
  return json;
}

Json position_json(const AcceptancePosition& position) {
  Json json = {{"name", position.name}, {"artefact", position.artefact}, {"spheres", Json::array()}};
  for (const MeasuredSphere& sphere : position.spheres) json["spheres"].push_back(sphere_json(sphere));
  if (position.spacing) {
    const SphereSpacing& s = *position.spacing;
    json["spacing"] = {{"measured_mm", s.measured_mm},
                       {"calibrated_mm", s.calibrated_mm},
                       {"error", value_json(s.error)},
                       {"held_error", value_json(s.held_error)},
                       {"length_error", value_json(s.length_error)}};
  }
  if (position.plane) {
    const MeasuredPlane& p = *position.plane;
    Json plane = {{"point_mm", list_json(p.point_mm)}, {"normal", list_json(p.normal)}, {"length_mm", p.length_mm}};
    plane.update(figures_json(p.form_figures));
    plane["flatness"] = value_json(p.flatness);
    json["plane"] = std::move(plane);
  }
  return json;
}

}  // namespace

Json acceptance_json(const Acceptance& acceptance) {
  Json json = {{"part", acceptance.part}, {"characteristics", Json::array()}, {"positions", Json::array()}};
  for (const AcceptanceCharacteristic& of : acceptance.characteristics) {
    Json entry = {{"name", of.name}, {"about", of.about}};
    entry.update(value_json(of.value));
    entry["worst"] = of.worst;
    entry["positions"] = of.positions;
    entry["positions_asked"] = of.positions_asked;
    entry["limit_mm"] = of.limit_mm ? Json(*of.limit_mm) : Json(nullptr);
    entry["level"] = of.limit_mm ? Json(verdict_level_name(of.level)) : Json(nullptr);
    json["characteristics"].push_back(std::move(entry));
  }
  for (const AcceptancePosition& position : acceptance.positions) json["positions"].push_back(position_json(position));
  return {{"acceptance", std::move(json)}};
}

Json repeatability_json(const Repeatability& repeatability) {
  Json json = {{"verb", repeatability.verb}, {"runs", repeatability.runs}, {"groups", Json::array()}};
  for (const RepeatedGroup& group : repeatability.groups) {
    Json entry = {{"name", group.name},
                  {"about", group.about},
                  {"count", group.quantities.size()},
                  {"sd_mm", group.sd},
                  {"predicted_mm", group.predicted},
                  {"ratio", group.ratio},
                  {"ratio_low", group.ratio_low},
                  {"ratio_high", group.ratio_high},
                  {"dof", group.dof},
                  {"p", group.p}};
    entry["quantities"] = Json::array();
    for (const RepeatedQuantity& q : group.quantities) {
      entry["quantities"].push_back({{"name", q.name},
                                     {"mean_mm", q.mean},
                                     {"sd_mm", q.sd},
                                     {"sd_low_mm", q.sd_low},
                                     {"sd_high_mm", q.sd_high},
                                     {"predicted_mm", q.predicted},
                                     {"ratio", q.ratio},
                                     {"p", q.p},
                                     {"values_mm", q.values}});
    }
    json["groups"].push_back(std::move(entry));
  }
  return {{"repeatability", std::move(json)}};
}

}  // namespace crosstie::base
