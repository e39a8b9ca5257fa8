// The body of `calibrate` in base/result_document.h.
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

std::string lens_name(LensModel lens) { return std::string(lens_model_name(lens)); }

Json area_json(const CalibratedArea& area) {
  Json counts = Json::array();
  for (int row = 0; row < CalibratedArea::kCells; ++row) {
    for (int column = 0; column < CalibratedArea::kCells; ++column) counts.push_back(area.count(column, row));
  }
  return {{"cells", CalibratedArea::kCells},
          {"inner_share", area.inner_share()},
          {"border_share", area.border_share()},
          {"counts", std::move(counts)}};
}

Json camera_json(const CalibratedCamera& one) {
  Json json = detail::lens_json(one.name, one.camera, true);
  json["significance_p"] = detail::significance_json(one.significance_p);
  json["correlations"] = Json::array();
  for (const ParameterCorrelation& c : one.correlations)
    json["correlations"].push_back({{"a", c.a}, {"b", c.b}, {"r", c.value}});
  json["views"] = one.views;
  json["corners"] = one.corners;
  json["rms_px"] = one.rms_px;
  json["rms_heldout_px"] = one.rms_heldout_px > 0.0 ? Json(one.rms_heldout_px) : Json(nullptr);
  json["temperature_c"] = one.temperature_c ? Json(*one.temperature_c) : Json(nullptr);
  json["area"] = area_json(one.area);
  return json;
}

Json rig_json(const CalibratedRig& rig) {
  return {{"left", rig.left},
          {"right", rig.right},
          {"right_from_left", matrix_json(rig.right_from_left)},
          {"cov", upper_triangle_json(rig.cov)},
          {"baseline_mm", rig.baseline_mm},
          {"baseline_sigma_mm", rig.baseline_sigma_mm},
          {"stations", rig.stations}};
}

Json certificate_json(const Certificate& certificate) {
  if (!certificate.known()) return nullptr;
  const auto day = [](const auto& date) { return date ? Json(format_date(*date)) : Json(nullptr); };
  return {{"number", certificate.number}, {"issued", day(certificate.issued)}, {"valid_until", day(certificate.valid_until)}};
}

Json board_json(const CalibratedBoard& found) {
  const Board& board = found.board;
  Json json = {{"pattern", std::string(pattern_name(board.pattern))},
               {"columns", board.columns},
               {"rows", board.rows},
               {"pitch_mm", board.pitch_mm}};
  if (board.pattern == BoardPattern::kAprilGrid) json.update({{"tag_mm", board.tag_mm}, {"first_id", board.first_id}});
  json["temperature_c"] = board.temperature_c;
  json["cte_per_k"] = board.cte_per_k;
  json["shape"] = board.free ? "free" : "rigid";
  json["certificate"] = certificate_json(board.certificate);
  if (!board.free) return json;
  json["prior"] = {{"sigma_mm", board.prior.sigma_mm},
                   {"bend_sigma_mm", board.prior.bend_sigma_mm},
                   {"pitch_sigma_ppm", board.prior.pitch_sigma_ppm}};
  json["modes"] = Json::array();
  for (const CalibratedBoard::Mode& mode : found.modes) {
    json["modes"].push_back({{"name", mode.name},
                             {"unit", mode.unit},
                             {"prior_sigma", mode.prior_sigma},
                             {"value", mode.value},
                             {"sigma", mode.sigma}});
  }
  json["bend_rms_mm"] = found.bend_rms_mm;
  json["in_plane_rms_mm"] = found.in_plane_rms_mm;
  json["prior_ratio"] = found.prior_ratio;
  return json;
}

Json view_json(const CalibratedView& view, const Calibration& calibration) {
  return {{"image", view.image},
          {"camera", view.camera},
          {"station", calibration.stations[static_cast<std::size_t>(view.station)].name},
          {"board_from_camera", matrix_json(view.board_from_camera)},
          {"corners", view.corners},
          {"rejected", view.rejected},
          {"rms_px", view.rms_px},
          {"max_px", view.max_px},
          {"distance_mm", view.distance_mm},
          {"tilt_rad", view.tilt_rad}};
}

Json fold_json(const HeldOutFold& fold) {
  return {{"name", fold.name},
          {"stations", fold.stations},
          {"rms_heldout_px", fold.rms_px},
          {"baseline_mm", fold.baseline_mm},
          {"baseline_sigma_mm", fold.baseline_sigma_mm}};
}

Json validation_json(const CrossValidation& validation) {
  Json json = {{"halves", Json::array()}, {"folds", Json::array()}};
  for (const HeldOutFold& half : validation.halves) json["halves"].push_back(fold_json(half));
  for (const HeldOutFold& fold : validation.folds) json["folds"].push_back(fold_json(fold));
  json["baseline_gap_mm"] = validation.baseline_gap_mm;
  json["baseline_gap_sigma_mm"] = validation.baseline_gap_sigma_mm;
  json["model_difference_px"] = validation.model_difference_px;
  json["model_difference_predicted_px"] = validation.model_difference_predicted_px;
  return json;
}

Json trial_json(const LensTrial& trial) {
  return {{"model", lens_name(trial.lens)},           {"rms_px", trial.rms_px}, {"rms_heldout_px", trial.rms_heldout_px},
          {"worse_by_sigmas", trial.worse_by_sigmas}, {"chosen", trial.chosen}, {"failure", trial.failure}};
}

Json detector_json(const DetectorTrial& trial) {
  return {{"detector", trial.detector},           {"images", trial.images}, {"corners", trial.corners},
          {"difference_px", trial.difference_px}, {"rms_px", trial.rms_px}, {"focal_px", trial.focal_px},
          {"baseline_mm", trial.baseline_mm},     {"used", trial.used},     {"failure", trial.failure}};
}

Json opinion_json(const SecondOpinion& opinion) {
  Json parameters = Json::array();
  for (const Eigen::VectorXd& one : opinion.parameters) parameters.push_back(list_json(one));
  return {
      {"program", opinion.program},
      {"model", lens_name(opinion.lens)},
      {"board", opinion.board},
      {"rms_px", opinion.rms_px},
      {"params", std::move(parameters)},
      {"right_from_left", opinion.right_from_left ? matrix_json(*opinion.right_from_left) : Json(nullptr)},
      {"baseline_mm", opinion.baseline_mm},
      {"rejected", opinion.rejected},
      {"ours", {{"rms_px", opinion.our_rms_px}, {"focal_px", opinion.our_focal_px}, {"baseline_mm", opinion.our_baseline_mm}}},
      {"bends_mm", list_json(opinion.bends_mm)},
      {"difference",
       {{"distance_mm", opinion.distance_mm}, {"rms_px", opinion.difference_rms_px}, {"max_px", opinion.difference_max_px}}},
      {"failure", opinion.failure}};
}

}  // namespace

Json calibration_json(const Calibration& calibration) {
  Json json;
  detail::add_figures(calibration, json);
  for (const char* key : {"cameras", "rig", "board", "stations", "views", "rejected", "validation", "ladder", "detectors"})
    json[key] = Json::array();
  for (const CalibratedCamera& camera : calibration.cameras) json["cameras"].push_back(camera_json(camera));
  json["rig"] = calibration.rig ? rig_json(*calibration.rig) : Json(nullptr);
  json["board"] = board_json(calibration.board);
  for (const CalibratedStation& station : calibration.stations) {
    json["stations"].push_back(
        {{"name", station.name}, {"paired", station.paired}, {"board_from_rig", matrix_json(station.board_from_rig)}});
  }
  for (const CalibratedView& view : calibration.views) json["views"].push_back(view_json(view, calibration));
  for (const RejectedCorner& r : calibration.rejected) {
    json["rejected"].push_back({{"image", r.image}, {"corner", r.corner}, {"reason", r.reason}, {"w", r.w}});
  }
  json["validation"] = calibration.validation ? validation_json(*calibration.validation) : Json(nullptr);
  for (const LensTrial& trial : calibration.ladder) json["ladder"].push_back(trial_json(trial));
  for (const DetectorTrial& trial : calibration.detectors) json["detectors"].push_back(detector_json(trial));
  json["second_opinion"] = calibration.second_opinion ? opinion_json(*calibration.second_opinion) : Json(nullptr);
  return json;
}

}  // namespace crosstie::base
