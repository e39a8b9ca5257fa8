// observations -> coordinates

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/result_folder.h"
#include "app/steps.h"
#include "app/verdicts.h"
#include "base/camera_file.h"
#include "base/cloud.h"
#include "base/file.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/ply.h"
#include "base/result_document.h"
#include "bundle/adjust.h"
#include "report/bundle_report.h"
#include "report/tables.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

constexpr const char* kObservationsInput = "results/detect/observations.csv";

tl::unexpected<base::Error> bad_job(const Job& job, const std::string& message) {
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", job.file.string(), message));
}

/// The images as the detection describes them, each with the camera that the job gives it.
Result<std::vector<base::ImageObservations>> observed_images(const fs::path& detection) {
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

/// Focal length in px with which a camera starts.
Result<double> nominal_focal_px(const Job& job, const std::string& name, const JobCamera& camera, int width_px,
                                const fs::path& photograph) {
  if (camera.focal_px) return *camera.focal_px;
  if (camera.focal_mm) return *camera.focal_mm / *camera.sensor_width_mm * width_px;
  if (const auto from_exif = base::exif_focal_px(photograph)) return *from_exif;
  return bad_job(
      job,
      fmt::format("nothing is known of the focal length of camera {}: give focal_mm and sensor_width_mm, focal_px or a model "
                  "in [camera.{}]; the photographs carry no EXIF data",
                  name, name));
}

Result<base::NetworkCamera> start_camera(const Job& job, const std::string& name, int width_px, int height_px,
                                         const fs::path& photograph) {
  const JobCamera& settings = job.cameras.at(name);
  if (settings.model) {
    auto camera = base::read_camera(job.resolve(*settings.model));
    if (!camera) return base::fail(std::move(camera));
    if (camera->width_px() != width_px || camera->height_px() != height_px) {
      return bad_job(job, fmt::format("the model of camera {} is for {} x {} pixels, its photographs have {} x {}", name,
                                      camera->width_px(), camera->height_px(), width_px, height_px));
    }
    return base::NetworkCamera{name, std::move(*camera), settings.estimate};
  }
  static const std::map<std::string, base::LensModel> kLenses = {{"pinhole", base::LensModel::kPinhole},
                                                                 {"opencv4", base::LensModel::kOpenCv4},
                                                                 {"opencv5", base::LensModel::kOpenCv5},
                                                                 {"opencv8", base::LensModel::kOpenCv8},
                                                                 {"opencv12", base::LensModel::kOpenCv12}};
  const auto focal_px = nominal_focal_px(job, name, settings, width_px, photograph);
  if (!focal_px) return tl::unexpected(focal_px.error());
  auto camera = base::Camera::nominal(kLenses.at(settings.lens), width_px, height_px, *focal_px);
  if (!camera) return base::fail(std::move(camera));
  return base::NetworkCamera{name, std::move(*camera), true};
}

/// Which file and camera an image of the detection has.
struct Photographs {
  std::map<std::string, const ImageFile*> by_name;
  explicit Photographs(const DetectionTask& task) {
    for (const ImageFile& file : task.images) by_name[file.name] = &file;
  }
};

Result<std::vector<base::NetworkCamera>> start_cameras(const Job& job, const std::vector<base::ImageObservations>& images,
                                                       const Photographs& photographs) {
  std::map<std::string, const base::ImageObservations*> first;
  for (const base::ImageObservations& image : images) {
    const auto [it, added] = first.emplace(image.camera, &image);
    if (!added && (it->second->width_px != image.width_px || it->second->height_px != image.height_px)) {
      return bad_job(
          job, fmt::format("camera {} has images of different sizes: {} and {}", image.camera, it->second->image, image.image));
    }
  }
  std::vector<base::NetworkCamera> cameras;
  for (const auto& [name, image] : first) {
    auto camera = start_camera(job, name, image->width_px, image->height_px, photographs.by_name.at(image->image)->path);
    if (!camera) return base::fail(std::move(camera));
    cameras.push_back(std::move(*camera));
  }
  return cameras;
}

/// The distance of the reference that defines the scale; with a sigma where the reference states both points' covariances.
Result<base::ScaleBar> distance_of_reference(const Job& job) {
  const auto [id_a, id_b] = *job.network->scale_from;
  const auto reference = base::read_point_list(job.resolve(*job.reference_points), {job.reference_unit});
  if (!reference) return tl::unexpected(reference.error());
  const base::ReferencePoint* a = reference->find(id_a);
  const base::ReferencePoint* b = reference->find(id_b);
  if (a == nullptr || b == nullptr) {
    return bad_job(job,
                   fmt::format("scale_from = [{}, {}]: the reference has no point {}", id_a, id_b, a == nullptr ? id_a : id_b));
  }
  const Eigen::Vector3d along = b->xyz_mm - a->xyz_mm;
  base::ScaleBar bar;
  bar.id_a = id_a;
  bar.id_b = id_b;
  bar.length_mm = along.norm();
  bar.certificate = "distance of the reference";
  bar.role = base::ScaleBarRole::kDefines;
  if (a->cov_mm2 && b->cov_mm2) {
    const Eigen::Vector3d direction = along.normalized();
    bar.sigma_mm = std::sqrt(direction.dot((*a->cov_mm2 + *b->cov_mm2) * direction));
    bar.role = base::ScaleBarRole::kUsed;
  }
  return bar;
}

Result<base::Network> network_of(const Job& job, const fs::path& detection) {
  auto task = detection_task(job);
  if (!task) return base::fail(std::move(task));
  const Photographs photographs(*task);
  auto images = observed_images(detection);
  if (!images) return base::fail(std::move(images));
  base::Network network;
  for (base::ImageObservations& image : *images) {
    const auto file = photographs.by_name.find(image.image);
    if (file == photographs.by_name.end()) {
      return bad_job(job, fmt::format("{} holds the image {}, which is not one of the job's",
                                      (detection / "observations.csv").string(), image.image));
    }
    image.camera = file->second->camera;
    image.family = job.family;
    network.images.push_back(std::move(image));
  }
  auto cameras = start_cameras(job, network.images, photographs);
  if (!cameras) return base::fail(std::move(cameras));
  network.cameras = std::move(*cameras);
  if (job.network->scale_bars) {
    auto bars = base::read_scale_bars(job.resolve(*job.network->scale_bars));
    if (!bars) return base::fail(std::move(bars));
    network.scale_bars = std::move(*bars);
  }
  if (job.network->scale_from) {
    auto bar = distance_of_reference(job);
    if (!bar) return base::fail(std::move(bar));
    network.scale_bars.push_back(std::move(*bar));
  }
  network.scale_is_free = job.network->scale_is_free;
  return network;
}

Result<std::vector<base::ResultInput>> inputs_of(const Job& job, const fs::path& detection) {
  std::set<fs::path> files;
  for (const auto& [name, camera] : job.cameras) {
    if (camera.model) files.insert(job.resolve(*camera.model));
  }
  if (job.network->scale_bars) files.insert(job.resolve(*job.network->scale_bars));
  if (job.network->scale_from) files.insert(job.resolve(*job.reference_points));
  std::vector<base::ResultInput> inputs;
  auto observations = base::sha256_of_file(detection / "observations.csv");
  if (!observations) return base::fail(std::move(observations));
  inputs.push_back({kObservationsInput, std::move(*observations)});  // by its place in the job, wherever --out puts it
  for (const fs::path& file : files) {
    auto input = hashed_input(file, job.folder);
    if (!input) return base::fail(std::move(input));
    inputs.push_back(std::move(*input));
  }
  std::sort(inputs.begin(), inputs.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
  return inputs;
}

/// All of the job that the adjustment depends on, apart from files.
ordered_json effective_options(const Job& job, const bundle::AdjustOptions& options) {
  ordered_json json = {{"significance", options.significance}, {"min_angle_rad", options.min_angle_rad}};
  json["cameras"] = ordered_json::object();
  for (const auto& [name, camera] : job.cameras) {
    ordered_json& entry = json["cameras"][name];
    entry = {{"lens", camera.lens}, {"estimate", camera.estimate}};
    if (camera.model) entry["model"] = camera.model->generic_string();
    if (camera.focal_px) entry["focal_px"] = *camera.focal_px;
    if (camera.focal_mm) entry["focal_mm"] = *camera.focal_mm;
    if (camera.sensor_width_mm) entry["sensor_width_mm"] = *camera.sensor_width_mm;
  }
  if (job.network->scale_from) json["scale_from"] = {job.network->scale_from->first, job.network->scale_from->second};
  json["scale_is_free"] = job.network->scale_is_free;
  json["limits"] = {{"sigma0_px", job.limits.sigma0_px}, {"scale_bar_w", job.limits.scale_bar_w}};
  if (job.limits.point_sigma_mm) json["limits"]["point_sigma_mm"] = *job.limits.point_sigma_mm;
  return json;
}

base::Cloud cloud_of(const base::AdjustedNetwork& network) {
  base::Cloud cloud;
  cloud.frame = "network";
  base::CloudField id{"id", {}};
  base::CloudField sigma{"sigma_mm", {}};
  for (const base::AdjustedPoint& point : network.points) {
    cloud.points.push_back(point.xyz_mm);
    cloud.cov_mm2.push_back(point.cov_mm2);
    id.values.push_back(point.id);
    sigma.values.push_back(std::sqrt(point.cov_mm2.trace()));
  }
  cloud.fields = {std::move(id), std::move(sigma)};
  return cloud;
}

Result<> write_files(const fs::path& folder, const base::AdjustedNetwork& network) {
  if (auto written = report::write_bundle_tables(folder, network); !written) return written;
  if (auto written = base::write_ply(folder / "points.ply", cloud_of(network)); !written) return written;
  for (const base::AdjustedCamera& camera : network.cameras) {
    if (auto written = base::write_cameramodel(folder / (camera.name + ".cameramodel"), camera.camera); !written)
      return written;
  }
  if (network.covariance.size() == 0) return {};
  return base::write_covariance(folder, {network.covariance, network.labels});
}

}  // namespace

Result<> check_scale(const Job& job) {
  if (!job.network || job.network->scale_bars || job.network->scale_from || job.network->scale_is_free) return {};
  return base::fail(
      ErrorCode::kNoUniqueSolution,
      fmt::format("{}: nothing gives the network its scale: add scale_bars or scale_from to [network], or scale = \"free\" "
                  "for coordinates in an arbitrary unit",
                  job.file.string()));
}

Result<StepOutcome> adjust_step(const Job& job, const fs::path& detection, const fs::path& out, Session& session) {
  const bundle::AdjustOptions adjust_options;
  const ordered_json options = effective_options(job, adjust_options);
  auto inputs = inputs_of(job, detection);
  if (!inputs) return base::fail(std::move(inputs));
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const auto network = network_of(job, detection);
  if (!network) return tl::unexpected(network.error());
  const auto adjusted = bundle::adjust(*network, adjust_options, session.progress());
  if (!adjusted) return tl::unexpected(adjusted.error());

  base::ResultEnvelope envelope{"adjust", "network", *inputs, judge(*adjusted, job.limits), adjusted->warnings};
  if (auto written = write_files(folder->path(), *adjusted); !written) return base::fail(std::move(written));
  const std::string html = report::bundle_report(*adjusted, {"Bundle adjustment", job.name, envelope, options.dump(2)});
  const ordered_json result = base::result_json(envelope, options, base::network_json(*adjusted));
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out,
                     fmt::format("{} points from {} images, sigma0 {:.4f} px, redundancy {}, {} rejected, {} warnings",
                                 adjusted->points.size(), adjusted->images.size(), adjusted->sigma0_px, adjusted->redundancy,
                                 adjusted->rejected.size(), adjusted->warnings.size()),
                     false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
