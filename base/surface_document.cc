#include "base/surface_document.h"

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;

Json surface_json(const SurfaceDeviations& s) {
  Json json = {
      {"reference", s.reference}, {"count", s.count},     {"beyond_border", s.beyond_border}, {"too_far", s.too_far},
      {"gate_mm", s.gate_mm},     {"mean_mm", s.mean_mm}, {"sigma_mm", s.sigma_mm},           {"rms_mm", s.rms_mm},
      {"p95_mm", s.p95_mm},       {"max_mm", s.max_mm},   {"tolerance_mm", s.tolerance_mm},   {"in_tolerance", s.in_tolerance}};
  json["normalised_rms"] = s.normalised_rms ? Json(*s.normalised_rms) : Json(nullptr);
  json["reference_from_measured"] = detail::matrix_json(s.reference_from_measured);
  json["best_fit"] = s.best_fit;
  json["held"] = s.held;
  return json;
}

Json shape_json(const ShapeDeviations& s) {
  Json json = {{"shape", s.shape},
               {"point_mm", list_json(s.point_mm)},
               {"direction", list_json(s.direction)},
               {"direction_sigma_rad", list_json(s.direction_sigma_rad)},
               {"diameter_mm", s.diameter_mm},
               {"diameter_sigma_mm", s.diameter_sigma_mm},
               {"apex_angle_rad", s.apex_angle_rad},
               {"apex_angle_sigma_rad", s.apex_angle_sigma_rad},
               {"extent_mm", {s.low_mm, s.high_mm}},
               {"end_diameters_mm", {s.low_diameter_mm, s.high_diameter_mm}},
               {"end_diameter_sigmas_mm", {s.low_diameter_sigma_mm, s.high_diameter_sigma_mm}},
               {"rms_mm", s.rms_mm},
               {"form_mm", s.form_mm},
               {"count", s.count},
               {"rejected", s.rejected}};
  if (!s.difference) return json;
  const ShapeDeviations::Difference& d = *s.difference;
  json["difference"] = {{"axis_angle_rad", d.axis_angle_rad},     {"axis_angle_sigma_rad", d.axis_angle_sigma_rad},
                        {"axis_distance_mm", d.axis_distance_mm}, {"axis_distance_sigma_mm", d.axis_distance_sigma_mm},
                        {"diameter_mm", d.diameter_mm},           {"diameter_sigma_mm", d.diameter_sigma_mm},
                        {"apex_angle_rad", d.apex_angle_rad},     {"apex_angle_sigma_rad", d.apex_angle_sigma_rad}};
  return json;
}

Json edge_json(const EdgeVerification& e) {
  Json json = {{"count", e.count}, {"rms_mm", e.rms_mm}, {"p95_mm", e.p95_mm}, {"max_mm", e.max_mm}};
  json["normalised_rms"] = e.normalised_rms > 0.0 ? Json(e.normalised_rms) : Json(nullptr);
  return json;
}

}  // namespace

Json surface_verification_json(const SurfaceVerification& verification) {
  Json json = Json::object();
  if (verification.surface) json["surface"] = surface_json(*verification.surface);
  if (verification.shape) json["shape"] = shape_json(*verification.shape);
  if (verification.edge) json["edge"] = edge_json(*verification.edge);
  return json;
}

}  // namespace crosstie::base
