// The body of `verify` in base/result_document.h.
#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/result_document.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;

Json deviation_json(const Deviation& d) {
  return {{"id", d.id},
          {"reference_mm", list_json(d.reference_mm)},
          {"measured_mm", list_json(d.measured_mm)},
          {"deviation_mm", list_json(d.deviation_mm)},
          {"untransformed_mm", list_json(d.untransformed_mm)},
          {"sigma_mm", list_json(d.sigma_mm)},
          {"used", d.used}};
}

Json by_position_json(const PositionComparison& comparison) {
  Json json;
  json["gate_mm"] = comparison.gate_mm;
  json["count"] = comparison.points.size();
  json["rms_mm"] = list_json(comparison.rms_mm);
  json["rms3d_mm"] = comparison.rms3d_mm;
  json["max_mm"] = comparison.max_mm;
  json["normalised_rms"] = comparison.normalised_rms;
  json["points"] = Json::array();
  for (const auto& deviation : comparison.points) {
    Json point = deviation_json(deviation);
    point["reference_id"] = deviation.reference_id;
    json["points"].push_back(std::move(point));
  }
  json["unpaired"] = comparison.unpaired;
  return json;
}

Json length_json(const LengthDeviation& l) {
  return {{"a", l.id_a},
          {"b", l.id_b},
          {"nominal_mm", l.nominal_mm},
          {"measured_mm", l.measured_mm},
          {"error_mm", l.measured_mm - l.nominal_mm},
          {"sigma_mm", l.sigma_mm},
          {"mpe_mm", l.mpe_mm}};
}

}  // namespace

Json verification_json(const Verification& verification) {
  const auto used =
      std::count_if(verification.points.begin(), verification.points.end(), [](const Deviation& d) { return d.used; });
  Json json;
  json["fit"] = verification.fit;
  json["count"] = used;
  json["rms_mm"] = list_json(verification.rms_mm);
  json["max_mm"] = verification.max_mm;
  json["rms3d_mm"] = verification.rms3d_mm;
  json["normalised_rms"] = verification.normalised_rms;
  json["transform"] = detail::matrix_json(verification.reference_from_measured);
  json["transform_cov"] = detail::upper_triangle_json(verification.pose_cov);
  json["scale_ppm"] = verification.scale_ppm;
  json["scale_sigma_ppm"] = verification.scale_sigma_ppm;
  json["length_rms_mm"] = verification.length_rms_mm;
  json["length_max_mm"] = verification.length_max_mm;
  json["lengths"] = Json::array();
  for (const auto& length : verification.lengths) json["lengths"].push_back(length_json(length));
  json["points"] = Json::array();
  for (const auto& deviation : verification.points) json["points"].push_back(deviation_json(deviation));
  json["by_position"] = by_position_json(verification.by_position);
  json["only_measured"] = verification.only_measured;
  json["only_reference"] = verification.only_reference;
  return json;
}

}  // namespace crosstie::base
