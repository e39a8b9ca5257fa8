// The body of `plan` in base/plan.h.
#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <nlohmann/json.hpp>

#include "base/detail/adjustment_json.h"
#include "base/detail/result_json.h"
#include "base/plan.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;
using detail::matrix_json;
using detail::upper_triangle_json;

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json head_json(const Calibration& calibration) {
  Json json = {{"views", calibration.views.size()}, {"cameras", Json::array()}, {"rig", nullptr}};
  for (const CalibratedCamera& one : calibration.cameras) {
    json["cameras"].push_back({{"name", one.name},
                               {"model", lens_model_name(one.camera.model())},
                               {"sigmas", list_json(one.camera.covariance().diagonal().cwiseMax(0.0).cwiseSqrt())}});
  }
  if (calibration.rig) {
    json["rig"] = {{"baseline_mm", calibration.rig->baseline_mm},
                   {"baseline_sigma_mm", calibration.rig->baseline_sigma_mm},
                   {"cov", upper_triangle_json(calibration.rig->cov)}};
  }
  return json;
}

Json motion_json(const PlannedMotion& motion) {
  return {{"name", motion.name},
          {"order", motion.order},
          {"unit", motion.angle ? "rad" : "mm"},
          {"sigma", motion.sigma},
          {"smallest", motion.smallest},
          {"smallest_peak_to_valley", motion.smallest * motion.range_factor},
          {"in_model", motion.in_model}};
}

Json machine_json(const CommissionPlan& plan) {
  const Commissioning& expected = plan.expected;
  const LinearAxis& axis = expected.frame.axis;
  Json json = {{"observations", expected.observations},
               {"unknowns", expected.unknowns},
               {"redundancy", expected.redundancy},
               {"level", plan.level},
               {"power", plan.power},
               {"baseline_sigma_mm", expected.baseline_sigma_mm},
               {"direction_sigma_rad", plan.direction_sigma_rad},
               {"direction_cov", upper_triangle_json(axis.direction_cov)},
               {"scale_sigma_ppm", axis.scale_sigma_ppm},
               {"scale_smallest_ppm", plan.scale_smallest_ppm},
               {"motions", Json::array()},
               {"machine_from_rig", Json::array()},
               {"tre", Json::array()}};
  for (const PlannedMotion& motion : plan.motions) json["motions"].push_back(motion_json(motion));
  for (const HeadPose& pose : expected.checked_at) json["machine_from_rig"].push_back(detail::head_pose_json(pose));
  for (const FramePoint& point : expected.tre) {
    json["tre"].push_back({{"axis_mm", point.axis_mm},
                           {"p_in_machine_mm", list_json(point.p_in_machine_mm)},
                           {"cov_mm2", upper_triangle_json(point.cov_mm2)}});
  }
  return json;
}

Json point_json(const PlannedPoint& point) {
  return {{"p_in_machine_mm", list_json(point.p_in_machine_mm)},
          {"axis_mm", point.axis_mm},
          {"frame_cov_mm2", upper_triangle_json(point.frame_cov_mm2)},
          {"cov_mm2", point.cov_mm2 ? upper_triangle_json(*point.cov_mm2) : Json(nullptr)}};
}

Json network_plan_json(const NetworkPlan& plan) {
  Json json = {{"observations", plan.expected.observations},
               {"unknowns", plan.expected.unknowns},
               {"redundancy", plan.expected.redundancy},
               {"datum", plan.expected.datum},
               {"scale", plan.expected.scale},
               {"median_mm", plan.median_mm},
               {"max_mm", plan.max_mm},
               {"points", Json::array()}};
  for (const AdjustedPoint& point : plan.expected.points) {
    json["points"].push_back({{"id", point.id},
                              {"xyz_mm", list_json(point.xyz_mm)},
                              {"cov_mm2", upper_triangle_json(point.cov_mm2)},
                              {"rays", point.rays},
                              {"angle_rad", point.angle_rad}});
  }
  return json;
}

Json variant_json(const PlanVariant& variant) {
  Json json = {
      {"what", variant.what}, {"value", variant.value}, {"as_planned", variant.as_planned}, {"failure", variant.failure}};
  if (!variant.failure.empty()) return json;
  json["points_mm"] = variant.points_mm;
  json["direction_sigma_rad"] = variant.direction_sigma_rad;
  json["scale_sigma_ppm"] = variant.scale_sigma_ppm;
  json["baseline_sigma_mm"] = variant.baseline_sigma_mm;
  json["smallest_straightness_mm"] = number_or_null(variant.straightness_mm);
  json["smallest_roll_rad"] = number_or_null(variant.roll_rad);
  json["smallest_pitch_rad"] = number_or_null(variant.pitch_rad);
  json["smallest_yaw_rad"] = number_or_null(variant.yaw_rad);
  json["network_median_mm"] = variant.network_median_mm;
  json["network_max_mm"] = variant.network_max_mm;
  return json;
}

Json rehearsal_json(const Rehearsal& rehearsal) {
  Json json = {{"draws", rehearsal.draws},
               {"failed", rehearsal.failed},
               {"first_failure", rehearsal.first_failure},
               {"quantities", Json::array()}};
  for (const RehearsedQuantity& one : rehearsal.quantities) {
    json["quantities"].push_back({{"name", one.name},
                                  {"dof", one.dof},
                                  {"mean_square", one.square},
                                  {"low", one.low},
                                  {"high", one.high},
                                  {"holds", one.holds()}});
  }
  return json;
}

}  // namespace

double worst_sigma(const Eigen::Matrix3d& cov) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(cov, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()(2)));
}

nlohmann::ordered_json plan_json(const ScenePlan& plan) {
  Json json = {{"scene", plan.scene}, {"image_sigma_px", plan.image_sigma_px}, {"corner_sigma_px", plan.corner_sigma_px}};
  json["calibration"] = plan.calibration ? head_json(*plan.calibration) : Json(nullptr);
  json["machine"] = plan.machine ? machine_json(*plan.machine) : Json(nullptr);
  json["points"] = Json::array();
  for (const PlannedPoint& point : plan.points) json["points"].push_back(point_json(point));
  json["network"] = plan.network ? network_plan_json(*plan.network) : Json(nullptr);
  json["variants"] = Json::array();
  for (const PlanVariant& variant : plan.variants) json["variants"].push_back(variant_json(variant));
  json["rehearsal"] = plan.rehearsal ? rehearsal_json(*plan.rehearsal) : Json(nullptr);
  return json;
}

}  // namespace crosstie::base
