// The body of `compare` in base/model_comparison.h.
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/detail/result_reading.h"
#include "base/model_comparison.h"

namespace crosstie::base {
namespace {

using detail::Json;

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

nlohmann::ordered_json model_comparison_json(const ModelComparison& comparison) {
  const ProjectionDifference& difference = comparison.difference;
  Json json;
  json["a"] = detail::lens_json(comparison.a.name, comparison.a.camera, false);
  json["b"] = detail::lens_json(comparison.b.name, comparison.b.camera, false);
  json["distance_mm"] = difference.distance_mm > 0.0 ? Json(difference.distance_mm) : Json(nullptr);
  json["b_from_a"] = detail::matrix_json(difference.b_from_a);
  json["rotation_rad"] = rotation_log(difference.b_from_a.rotation).norm();
  json["translation_mm"] = difference.b_from_a.translation_mm.norm();
  json["cells"] = difference.cells;
  json["grid"] = {difference.grid.columns, difference.grid.rows};
  json["rms_px"] = difference.rms_px;
  json["max_px"] = difference.max_px;
  json["rms_before_px"] = difference.rms_before_px;
  json["max_before_px"] = difference.max_before_px;
  json["quantiles"] = Json::array();
  for (const DifferenceQuantile& one : quantiles(difference)) {
    json["quantiles"].push_back({{"share", one.share},
                                 {"after_px", number_or_null(one.after_px)},
                                 {"before_px", number_or_null(one.before_px)},
                                 {"sigma_px", number_or_null(one.sigma_px)}});
  }
  json["test"] = nullptr;
  if (difference.test) {
    json["test"] = {{"rms_sigma_px", difference.test->rms_sigma_px},
                    {"ratio", difference.rms_px / difference.test->rms_sigma_px},
                    {"degrees", difference.test->degrees},
                    {"p", difference.test->p},
                    {"level", difference.test->level},
                    {"limit_px", difference.test->limit_px},
                    {"exceeded", difference.test->exceeded()}};
  }
  return json;
}

}  // namespace crosstie::base
