#include "base/detail/result_reading.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::base::detail {

tl::unexpected<Error> bad_result(const std::filesystem::path& path, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), what));
}

Eigen::VectorXd numbers(const Json& json, Eigen::Index size) {
  if (!json.is_array() || json.size() != static_cast<std::size_t>(size)) {
    throw Unreadable(fmt::format("a list of {} numbers was expected", size));
  }
  Eigen::VectorXd values(size);
  for (Eigen::Index i = 0; i < size; ++i) values[i] = json[static_cast<std::size_t>(i)].get<double>();
  return values;
}

Eigen::MatrixXd symmetric(const Json& json, Eigen::Index size) {
  const Eigen::VectorXd values = numbers(json, size * (size + 1) / 2);
  Eigen::MatrixXd matrix(size, size);
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index k = i; k < size; ++k) matrix(i, k) = matrix(k, i) = values[next++];
  }
  return matrix;
}

Pose pose_of(const Json& json) {
  const Eigen::VectorXd values = numbers(json, 16);
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(values.data());
  const auto pose = pose_from_matrix(matrix);
  if (!pose) throw Unreadable(pose.error().message);
  return *pose;
}

Camera lens_of(const Json& json) {
  const auto model = lens_model_from_name(json.at("model").get<std::string>());
  if (!model) throw Unreadable("an unknown lens model");
  const int count = parameter_count(*model);
  auto camera =
      Camera::make(*model, json.at("width").get<int>(), json.at("height").get<int>(), numbers(json.at("params"), count));
  if (!camera) throw Unreadable(camera.error().message);
  if (json.contains("cov") && !json["cov"].is_null()) camera->set_covariance(symmetric(json["cov"], count));
  return *std::move(camera);
}

Head head_of(const Json& json) {
  const Json& cameras = json.at("cameras");
  const Json& rig = json.at("rig");
  if (!cameras.is_array() || cameras.size() != 2) throw Unreadable("a head has two cameras");
  Head head{.left_name = rig.at("left"),
            .right_name = rig.at("right"),
            .left = lens_of(cameras.at(0)),
            .right = lens_of(cameras.at(1)),
            .right_from_left = pose_of(rig.at("right_from_left"))};
  if (const Json& temperature = rig.at("temperature_c"); !temperature.is_null()) head.temperature_c = temperature;
  return head;
}

std::optional<Eigen::Index> row_of(const std::vector<std::string>& labels, const std::string& parameter) {
  const auto found = std::find_if(labels.begin(), labels.end(), [&](const std::string& label) {
    return label == parameter || label.starts_with(parameter + " [");
  });
  return found == labels.end() ? std::nullopt : std::optional(found - labels.begin());
}

void check_verb(const Json& json, std::string_view verb) {
  const Json& format = json.at("format");
  if (format.is_string() && format != std::string(kResultFormat) && format.get<std::string>().starts_with("crosstie-result/")) {
    throw Unreadable(fmt::format("its format is {}, and this version of crosstie reads {}; compute it again",
                                 format.get<std::string>(), kResultFormat));
  }
  if (format != std::string(kResultFormat) || json.at("verb") != std::string(verb)) {
    throw Unreadable(fmt::format("not the result of {}", verb));
  }
}

Json lens_json(std::string_view name, const Camera& camera, bool estimated) {
  Json json;
  json["name"] = std::string(name);
  json["model"] = std::string(lens_model_name(camera.model()));
  json["width"] = camera.width_px();
  json["height"] = camera.height_px();
  json["estimated"] = estimated;
  json["param_names"] = Json::array();
  for (const auto parameter : parameter_names(camera.model())) json["param_names"].push_back(std::string(parameter));
  json["params"] = list_json(camera.parameters());
  const bool known = camera.covariance().size() > 0;
  json["sigmas"] = known ? list_json(Eigen::VectorXd(camera.covariance().diagonal().cwiseMax(0.0).cwiseSqrt())) : Json(nullptr);
  json["cov"] = known ? upper_triangle_json(camera.covariance()) : Json(nullptr);
  return json;
}

Json significance_json(const Eigen::VectorXd& p) {
  Json json = Json::array();
  for (const double value : p) json.push_back(std::isfinite(value) ? Json(value) : Json(nullptr));
  return json;
}

}  // namespace crosstie::base::detail
