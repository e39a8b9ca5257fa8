// What a calibration says over its images, of its pairs, and against an earlier one: keys of the body of `calibrate`.
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/calibration_quality.h"
#include "base/detail/result_json.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json figures_json(const MapFigures& figures) {
  return {
      {"median", number_or_null(figures.median)}, {"p95", number_or_null(figures.p95)}, {"max", number_or_null(figures.max)}};
}

Json points_json(const std::optional<TriangulationSigmas>& map) {
  if (!map) return nullptr;
  return {{"sigma_mm", figures_json(map_figures(map->sigma_mm, map->calibrated))},
          {"sigma_depth_mm", figures_json(map_figures(map->sigma_depth_mm, map->calibrated))},
          {"sigma_across_mm", figures_json(map_figures(map->sigma_across_mm, map->calibrated))}};
}

Json lens_change_json(const CalibrationChange::Lens& lens) {
  Json json = {{"name", lens.name}, {"failure", lens.failure}};
  if (!lens.difference) return json;
  const ProjectionDifference& difference = *lens.difference;
  json["rms_px"] = difference.rms_px;
  json["max_px"] = difference.max_px;
  json["cells"] = difference.cells;
  json["predicted_px"] = difference.test ? Json(difference.test->rms_sigma_px) : Json(nullptr);
  json["limit_px"] = difference.test ? Json(difference.test->limit_px) : Json(nullptr);
  json["p"] = difference.test ? Json(difference.test->p) : Json(nullptr);
  return json;
}

Json maps_json(const std::optional<CalibrationMaps>& maps, const std::vector<std::string>& names) {
  if (!maps) return nullptr;
  Json json = {{"distance_mm", maps->distance_mm}, {"cameras", Json::array()}};
  for (std::size_t c = 0; c < maps->cameras.size(); ++c) {
    const ProjectionSigmas& map = maps->cameras[c];
    json["cameras"].push_back({{"name", names.at(c)},
                               {"sigma_px", figures_json(map_figures(map.sigma_px, map.calibrated))},
                               {"sigma_mm", figures_json(map_figures(map.sigma_mm, map.calibrated))}});
  }
  json["points_in_rig"] = points_json(maps->in_rig);
  json["points_on_boards"] = points_json(maps->on_boards);
  return json;
}

Json epipolar_json(const std::vector<EpipolarPair>& pairs) {
  Json json = Json::array();
  for (const EpipolarPair& pair : pairs) {
    json.push_back({{"station", pair.station},
                    {"corners", pair.corners},
                    {"mean_px", pair.mean_px},
                    {"rms_px", pair.rms_px},
                    {"max_px", pair.max_px},
                    {"expected_px", pair.expected_px}});
  }
  return json;
}

Json change_json(const std::optional<CalibrationChange>& change) {
  if (!change) return nullptr;
  Json json = {
      {"previous", change->previous}, {"distance_mm", change->distance_mm}, {"cameras", Json::array()}, {"rig", nullptr}};
  for (const CalibrationChange::Lens& lens : change->cameras) json["cameras"].push_back(lens_change_json(lens));
  if (!change->rig) return json;
  const CalibrationChange::Rig& rig = *change->rig;
  json["rig"] = {{"change", list_json(rig.change)},
                 {"sigma", list_json(rig.sigma)},
                 {"baseline_before_mm", rig.baseline_before_mm},
                 {"baseline_change_mm", rig.baseline_change_mm},
                 {"baseline_sigma_mm", rig.baseline_sigma_mm}};
  return json;
}

}  // namespace

Json calibration_quality_json(const CalibrationQuality& quality, const std::vector<std::string>& cameras) {
  return {{"uncertainty", maps_json(quality.maps, cameras)},
          {"epipolar", epipolar_json(quality.epipolar)},
          {"change", change_json(quality.change)}};
}

}  // namespace crosstie::base
