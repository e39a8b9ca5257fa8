// scan summary -> JSON (docs/formats.md)

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/result_document.h"
#include "base/scan_summary.h"

namespace crosstie::base {
namespace {

using detail::Json;

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json stillness_json(const Stillness& still) {
  const auto told = [](bool is_told, double value) { return is_told ? Json(value) : Json(nullptr); };
  return {{"shift_px", told(still.shift_told, still.shift_px)},
          {"shift_sigma_px", told(still.shift_told, still.shift_sigma_px)},
          {"changed_share", told(still.compared, still.changed_share)},
          {"light_change", or_null(still.light_change)},
          {"ambient_change", or_null(still.ambient_change)},
          {"drift_px", told(still.drift_told, still.drift_px)},
          {"drift_sigma_px", told(still.drift_told, still.drift_sigma_px)}};
}

Json head_test_json(const HeadTest& test) {
  if (!test.done()) return nullptr;
  Json json = {{"source", test.source}, {"samples", test.samples}, {"off_px", test.off_px}, {"sigma_px", test.sigma_px}};
  json["terms"] = Json::array();
  for (const HeadTest::Term& term : test.terms) {
    json["terms"].push_back({{"name", term.name},
                             {"value_rad", term.value_rad},
                             {"sigma_rad", term.sigma_rad},
                             {"calibration_rad", term.calibration_rad > 0.0 ? Json(term.calibration_rad) : Json(nullptr)},
                             {"off_px", term.off_px},
                             {"explained", term.explained}});
  }
  json["places"] = Json::array();
  for (const HeadTest::Place& place : test.places)
    json["places"].push_back({place.left_px.x(), place.left_px.y(), place.off_px, place.sigma_px});
  return json;
}

Json camera_json(const ScannedCamera& camera) {
  const auto count = [&](PhaseStatus status) { return camera.counts[static_cast<std::size_t>(status)]; };
  return {{"name", camera.name},
          {"valid", count(PhaseStatus::kValid)},
          {"dark", count(PhaseStatus::kDark)},
          {"saturated", count(PhaseStatus::kSaturated)},
          {"undecided", count(PhaseStatus::kUndecided)},
          {"disturbed", count(PhaseStatus::kDisturbed)},
          {"noise", {{"read", camera.noise.read}, {"shot", camera.noise.shot}, {"given", camera.noise_given}}},
          {"light", camera.light},
          {"modulation", camera.modulation},
          {"sigma_phase_rad", camera.sigma_phase_rad},
          {"residual_ratio", camera.residual_ratio},
          {"ripple_rad", camera.ripple_rad},
          {"word_agreement", camera.word_agreement},
          {"repaired", camera.repaired},
          {"stillness", stillness_json(camera.stillness)}};
}

Json marker_json(const ScannedMarker& marker) {
  Json json = {{"id", marker.id},
               {"xyz_mm", detail::list_json(marker.p_in_rig_mm)},
               {"cov_mm2", detail::upper_triangle_json(marker.cov_mm2)},
               {"calibration_cov_mm2", detail::upper_triangle_json(marker.calibration_cov_mm2)},
               {"off_curve_px", marker.off_curve_px},
               {"off_curve_sigma_px", marker.off_curve_sigma_px},
               {"off_curve_calibration_px", marker.off_curve_calibration_px},
               {"wall_xyz_mm", nullptr},
               {"normal", nullptr},
               {"height_mm", nullptr},
               {"height_sigma_mm", nullptr}};
  if (!marker.on_wall()) return json;
  json["wall_xyz_mm"] = detail::list_json(marker.wall_in_rig_mm);
  json["normal"] = detail::list_json(marker.normal);
  json["height_mm"] = marker.height_mm;
  json["height_sigma_mm"] = marker.height_sigma_mm;
  return json;
}

Json edges_json(const ScannedCamera& camera, const ScannedEdges& edges) {
  return {{"camera", camera.name},      {"material", edges.material}, {"shadow", edges.shadow},    {"paint", edges.paint},
          {"sigma_px", edges.sigma_px}, {"blur_px", edges.blur_px},   {"piece_px", edges.piece_px}};
}

}  // namespace

Json scan_json(const ScanSummary& scan) {
  Json json = {{"points", scan.points}};
  json["masked"] = {{"guarded", scan.guarded}, {"unmatched", scan.unmatched},     {"off_curve", scan.off_curve},
                    {"grazing", scan.grazing}, {"off_surface", scan.off_surface}, {"on_markers", scan.on_markers}};
  json["sigma_phase_rad"] = {scan.cameras[0].sigma_phase_rad, scan.cameras[1].sigma_phase_rad};
  json["epipolar_median_px"] = nullptr;
  json["epipolar_mad_px"] = nullptr;
  if (scan.epipolar_median_px) {
    json["epipolar_median_px"] = *scan.epipolar_median_px;
    json["epipolar_mad_px"] = scan.epipolar_mad_px;
  }
  json["head_test"] = head_test_json(scan.head_test);
  json["sigma_mm"] = scan.sigma_mm;
  json["sigma_p95_mm"] = scan.sigma_p95_mm;
  json["calibration_mm"] = nullptr;
  if (scan.calibration_mm) json["calibration_mm"] = *scan.calibration_mm;
  json["depth_mm"] = {scan.depth_min_mm, scan.depth_max_mm};
  json["correlation_length_mm"] = scan.correlation_length_mm;
  json["marker_thickness_mm"] = scan.marker_thickness_mm;
  json["markers"] = Json::array();
  for (const ScannedMarker& marker : scan.markers) json["markers"].push_back(marker_json(marker));
  json["cameras"] = {camera_json(scan.cameras[0]), camera_json(scan.cameras[1])};
  json["image_px"] = {scan.width, scan.height};
  json["edges"] = {edges_json(scan.cameras[0], scan.edges[0]), edges_json(scan.cameras[1], scan.edges[1])};
  return json;
}

}  // namespace crosstie::base
