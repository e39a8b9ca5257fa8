#include "base/result_document.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/version.h"

namespace crosstie::base {

using detail::Json;

namespace detail {

Json matrix_json(const Pose& pose) {
  const Eigen::Matrix4d m = pose.matrix();
  Json json = Json::array();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) json.push_back(m(i, j));
  }
  return json;
}

Json warnings_json(const std::vector<Warning>& warnings) {
  Json json = Json::array();
  for (const Warning& w : warnings) json.push_back({{"code", w.code}, {"subject", w.subject}, {"message", w.message}});
  return json;
}

}  // namespace detail

Json result_json(const ResultEnvelope& envelope, const Json& options, const Json& body) {
  Json json;
  json["format"] = detail::kResultFormat;
  json["verb"] = envelope.verb;
  json["version"] = std::string(version());
  json["unit"] = "mm";
  json["frame"] = envelope.frame;
  json["inputs"] = Json::array();
  for (const ResultInput& input : envelope.inputs) json["inputs"].push_back({{"path", input.path}, {"sha256", input.sha256}});
  json["options"] = options.is_null() ? Json::object() : options;
  json["verdicts"] = Json::array();
  for (const Verdict& v : envelope.verdicts) {
    json["verdicts"].push_back({{"name", v.name},
                                {"value", v.value},
                                {"limit", v.limit},
                                {"unit", v.unit},
                                {"source", v.source},
                                {"level", std::string(verdict_level_name(v.level))}});
  }
  json["warnings"] = detail::warnings_json(envelope.warnings);
  for (const auto& [key, value] : body.items()) json[key] = value;
  return json;
}

Json detection_json(const std::vector<ImageObservations>& images, bool with_millis) {
  Json json;
  json["images"] = Json::array();
  for (const ImageObservations& image : images) {
    const auto count = [&](ObservationStatus status) {
      return std::count_if(image.observations.begin(), image.observations.end(),
                           [status](const Observation& o) { return o.status == status; });
    };
    json["images"].push_back({{"name", image.image},
                              {"camera", image.camera},
                              {"family", image.family},
                              {"width", image.width_px},
                              {"height", image.height_px},
                              {"count", count(ObservationStatus::kCoded)},
                              {"uncoded", count(ObservationStatus::kUncoded)},
                              {"ambiguous", count(ObservationStatus::kAmbiguous)},
                              {"unreadable", count(ObservationStatus::kUnreadable)},
                              {"refused", count(ObservationStatus::kRefused)},
                              {"saturated_fraction", image.saturated_fraction},
                              {"dark_fraction", image.dark_fraction},
                              {"millis", with_millis ? Json(image.millis) : Json(nullptr)}});
  }
  return json;
}

}  // namespace crosstie::base
