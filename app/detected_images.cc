#include "app/detected_images.h"

#include <map>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/result_document.h"

namespace crosstie::app {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

Result<std::vector<base::ImageObservations>> detected_images(const fs::path& detection) {
  auto images = base::read_observations(detection / "observations.csv");
  if (!images) return images;
  auto result = base::read_json(detection / "result.json");
  if (!result) return base::fail(std::move(result));
  std::map<std::string, base::ImageObservations> by_name;
  for (base::ImageObservations& image : *images) by_name.emplace(image.image, std::move(image));
  std::vector<base::ImageObservations> described;
  try {
    for (const ordered_json& json : result->at("images")) {
      base::ImageObservations image = std::move(by_name[json.at("name").get<std::string>()]);
      image.image = json.at("name");
      image.width_px = json.at("width");
      image.height_px = json.at("height");
      described.push_back(std::move(image));
    }
  } catch (const ordered_json::exception& error) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", (detection / "result.json").string(), error.what()));
  }
  return described;
}

}  // namespace crosstie::app
