// images -> observations

#include <algorithm>
#include <map>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/result_folder.h"
#include "app/steps.h"
#include "base/file.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/parallel.h"
#include "base/result_document.h"
#include "markers/mirrored.h"
#include "markers/overlay.h"
#include "report/detection_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::ImageObservations;
using base::Result;
using nlohmann::ordered_json;

fs::path overlay_name(const ImageFile& file) {
  std::string name = file.name;
  std::replace(name.begin(), name.end(), '/', '_');
  return fs::path("overlay") / (name + ".png");
}

ordered_json effective_options(const DetectionTask& task) {
  const markers::DetectOptions& detect = task.options;
  ordered_json options = {
      {"family", task.family.name},
      {"ids", detect.ids},
      {"min_radius_px", detect.min_radius_px},
      {"max_radius_px", detect.max_radius_px},
      {"min_axis_ratio", detect.min_axis_ratio},
      {"min_margin", detect.min_margin},
      {"min_contrast", detect.min_contrast},
      {"saturated_level", detect.saturated_level},
      {"dark_level", detect.dark_level},
  };
  for (const auto& [camera, level] : task.white_levels) options["white_level"][camera] = level;
  return options;
}

std::size_t coded_count(const ImageObservations& image) {
  return static_cast<std::size_t>(
      std::count_if(image.observations.begin(), image.observations.end(),
                    [](const auto& observation) { return observation.status == base::ObservationStatus::kCoded; }));
}

/// What is known of each image from an earlier result, by name: that of the same file, and nothing where a name now means another one.
/// `inputs` are the images' files, in their order, here and in the result.
std::map<std::string, ImageObservations> reusable(const ordered_json& earlier, const fs::path& folder,
                                                  const std::vector<ImageFile>& images,
                                                  const std::vector<base::ResultInput>& inputs) {
  std::map<std::string, ImageObservations> found;
  auto observations = base::read_observations(folder / "observations.csv");
  if (earlier.is_null() || !observations) return found;
  std::map<std::string, ImageObservations> by_name;
  for (ImageObservations& image : *observations) by_name.emplace(image.image, std::move(image));
  try {
    std::map<std::string, std::pair<const ordered_json*, const ordered_json*>> described;  // image and file
    for (std::size_t i = 0; i < earlier.at("images").size(); ++i) {
      const ordered_json& image = earlier["images"][i];
      described[image.at("name").get<std::string>()] = {&image, &earlier.at("inputs").at(i)};
    }
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto description = described.find(images[i].name);
      if (description == described.end()) continue;
      const ordered_json& file = *description->second.second;
      if (file.at("path") != inputs[i].path || file.at("sha256") != inputs[i].sha256) continue;
      ImageObservations image = by_name[images[i].name];
      const ordered_json& json = *description->second.first;
      image.image = images[i].name;
      image.width_px = json.at("width");
      image.height_px = json.at("height");
      image.saturated_fraction = json.at("saturated_fraction");
      image.dark_fraction = json.at("dark_fraction");
      if (json.at("count") == coded_count(image)) found.emplace(images[i].name, std::move(image));
    }
  } catch (const ordered_json::exception&) {
    found.clear();  // an older or foreign layout: everything is looked at again
  }
  return found;
}

Result<ImageObservations> look_at(const ImageFile& file, const DetectionTask& task, const fs::path& overlay) {
  auto image = base::read_image(file.path);
  if (!image) return base::fail(std::move(image));
  const auto level = task.white_levels.find(file.camera);
  if (level != task.white_levels.end()) image->set_white_level(level->second);
  auto observations = markers::detect(image->view(), task.family, task.options);
  if (!observations) {
    return base::fail(observations.error().code, fmt::format("{}: {}", file.path.string(), observations.error().message));
  }
  if (auto made = base::make_folder(overlay.parent_path()); !made) return base::fail(std::move(made));
  if (auto written = base::write_image(overlay, markers::overlay(image->view(), *observations)); !written) {
    return base::fail(std::move(written));
  }
  return observations;
}

/// `inputs` are the files of the images.
std::vector<base::Warning> warnings_of(const std::vector<ImageObservations>& images,
                                       const std::vector<base::ResultInput>& inputs, const DetectionTask& task) {
  constexpr double kOverexposed = 0.05;
  std::vector<base::Warning> warnings;
  std::map<std::string, std::string> first_of;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto [first, is_new] = first_of.emplace(inputs[i].sha256, images[i].image);
    if (is_new) continue;
    warnings.push_back({"duplicate_image", images[i].image,
                        fmt::format("{} and {} are the same photograph twice: what one of them shows would count double; "
                                    "remove one",
                                    first->second, images[i].image)});
  }
  for (const ImageObservations& image : images) {
    if (coded_count(image) == 0) {
      warnings.push_back({"no_markers", image.image,
                          "no coded marker of the family was found in this image; check family, focus and exposure"});
    }
    if (const auto mirrored = markers::mirror_warning(image, task.family, task.options.ids)) {
      warnings.push_back({"mirrored", image.image, *mirrored});
    }
    if (image.saturated_fraction > kOverexposed) {
      warnings.push_back({"overexposed", image.image,
                          fmt::format("{:.0f} % of the image is saturated; expose less", 100.0 * image.saturated_fraction)});
    }
  }
  return warnings;
}

}  // namespace

Result<StepOutcome> detect_step(const DetectionTask& task, const fs::path& out, bool timings, Session& session) {
  const ordered_json options = effective_options(task);
  const std::size_t count = task.images.size();
  std::vector<base::ResultInput> inputs(count);
  for (std::size_t i = 0; i < count; ++i) {
    auto input = hashed_input(task.images[i].path, task.base_folder);
    if (!input) return base::fail(std::move(input));
    inputs[i] = std::move(*input);
  }
  const ordered_json earlier = earlier_result(out, options);
  std::map<std::string, ImageObservations> known = reusable(earlier, out, task.images, inputs);
  if (!timings && known.size() == count && same_inputs(earlier, inputs)) {
    return StepOutcome{out, fmt::format("{} images, up to date", count), true, Outcome::kOk};
  }
  if (timings) known.clear();

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  std::vector<ImageObservations> images(count);
  auto done = base::parallel_for(count, session.threads(), "detect", session.progress(), [&](std::size_t i) -> Result<> {
    const ImageFile& file = task.images[i];
    const auto reused = known.find(file.name);
    if (reused != known.end() && folder->keep(overlay_name(file))) {
      images[i] = reused->second;
    } else {
      auto seen = look_at(file, task, folder->path() / overlay_name(file));
      if (!seen) return base::fail(std::move(seen));
      images[i] = std::move(*seen);
    }
    images[i].image = file.name;
    images[i].camera = file.camera;
    images[i].family = task.family.name;
    return {};
  });
  if (!done) return base::fail(std::move(done));

  base::ResultEnvelope envelope{"detect", "pixel", inputs, {}, warnings_of(images, inputs, task)};
  if (auto written = base::write_observations(folder->path() / "observations.csv", images); !written)
    return base::fail(std::move(written));
  const ordered_json result = base::result_json(envelope, options, base::detection_json(images, timings));
  std::vector<std::string> overlays;
  for (const ImageFile& file : task.images) overlays.push_back(overlay_name(file).generic_string());
  const std::string html = report::detection_report(
      images, overlays, {"Markers in the photographs", task.title, envelope, options.dump(2), overview_of(out, session)});
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  std::size_t coded = 0;
  for (const ImageObservations& image : images) coded += coded_count(image);
  return StepOutcome{out,
                     fmt::format("{} images, {} coded markers{}", count, coded,
                                 known.empty() ? "" : fmt::format(" ({} images as before)", known.size())),
                     false, Outcome::kOk};
}

}  // namespace crosstie::app
