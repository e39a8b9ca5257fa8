#include "app/network_input.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/detected_images.h"
#include "app/steps.h"
#include "base/calibration_reader.h"
#include "base/camera_file.h"
#include "base/file.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/network_reader.h"
#include "base/npy.h"
#include "base/table.h"

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

/// A camera file, or the camera of that name in the result of an adjustment, with its covariance.
Result<base::Camera> model_of_camera(const fs::path& path, const std::string& name) {
  std::error_code ignored;
  const bool is_result = fs::is_directory(path, ignored) || path.filename() == "result.json";
  if (!is_result) return base::read_camera(path);
  const auto network = base::read_adjusted_network(path.filename() == "result.json" ? path.parent_path() : path);
  if (!network) return tl::unexpected(network.error());
  for (const base::AdjustedCamera& camera : network->cameras) {
    if (camera.name == name) return camera.camera;
  }
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: that result has no camera {}", path.string(), name));
}

/// The sigmas that the job gives are the prior; of parameters without one it tells nothing.
Result<> know_sigmas(const Job& job, const std::string& name, const JobCamera& settings, base::Camera& camera) {
  if (settings.sigmas.empty()) return {};
  const auto names = base::parameter_names(camera.model());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(camera.parameters().size(), camera.parameters().size());
  prior.diagonal().setConstant(std::numeric_limits<double>::infinity());
  for (const auto& [parameter, sigma] : settings.sigmas) {
    const auto found = std::find(names.begin(), names.end(), parameter);
    if (found == names.end()) {
      return bad_job(job, fmt::format("[camera.{}] sigmas: {} has no parameter {}", name, base::lens_model_name(camera.model()),
                                      parameter));
    }
    prior(found - names.begin(), found - names.begin()) = sigma * sigma;
  }
  camera.set_covariance(std::move(prior));
  return {};
}

/// A camera as the board calibrated it, with its covariance as what is known beforehand.
Result<base::Camera> calibrated_camera(const Job& job, const std::string& name, const fs::path& calibration) {
  const auto read = base::read_calibration(calibration);
  if (!read) {
    return bad_job(job, fmt::format("camera {} is calibrated by its board_images, but there is no such result yet; `crosstie "
                                    "calibrate` or `crosstie run` makes it ({})",
                                    name, read.error().message));
  }
  for (const base::CalibratedCamera& one : read->cameras) {
    if (one.name == name) return one.camera;
  }
  return bad_job(job, fmt::format("{}: that calibration has no camera {}; calibrate again", calibration.string(), name));
}

Result<base::NetworkCamera> start_camera(const Job& job, const std::string& name, int width_px, int height_px,
                                         const fs::path& photograph, const fs::path& calibration) {
  const JobCamera& settings = job.cameras.at(name);
  const auto with_knowledge = [&](base::Camera camera, bool estimate) -> Result<base::NetworkCamera> {
    if (auto known = know_sigmas(job, name, settings, camera); !known) return base::fail(std::move(known));
    return base::NetworkCamera{name, std::move(camera), estimate, settings.fixed};
  };
  if (settings.model || settings.board_images) {
    auto camera =
        settings.model ? model_of_camera(job.resolve(*settings.model), name) : calibrated_camera(job, name, calibration);
    if (!camera) return base::fail(std::move(camera));
    if (camera->width_px() != width_px || camera->height_px() != height_px) {
      return bad_job(job, fmt::format("the model of camera {} is for {} x {} pixels, its photographs have {} x {}", name,
                                      camera->width_px(), camera->height_px(), width_px, height_px));
    }
    return with_knowledge(std::move(*camera), settings.estimate);
  }
  const auto focal_px = nominal_focal_px(job, name, settings, width_px, photograph);
  if (!focal_px) return tl::unexpected(focal_px.error());
  auto camera = base::Camera::nominal(settings.lens.value_or(base::LensModel::kOpenCv5), width_px, height_px, *focal_px);
  if (!camera) return base::fail(std::move(camera));
  return with_knowledge(std::move(*camera), true);
}

/// Which file and camera an image of the detection has.
struct Photographs {
  std::map<std::string, const ImageFile*> by_name;
  explicit Photographs(const DetectionTask& task) {
    for (const ImageFile& file : task.images) by_name[file.name] = &file;
  }
};

Result<std::vector<base::NetworkCamera>> start_cameras(const Job& job, const std::vector<base::ImageObservations>& images,
                                                       const Photographs& photographs, const fs::path& calibration) {
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
    auto camera =
        start_camera(job, name, image->width_px, image->height_px, photographs.by_name.at(image->image)->path, calibration);
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

/// Whether the network's photographs are those of a rig (rather than of a hand-held camera beside it).
bool rig_took_part(const Job& job) {
  if (!job.rig) return false;
  return std::any_of(job.network->images.begin(), job.network->images.end(), [&job](const auto& images) {
    return std::find(job.rig->cameras.begin(), job.rig->cameras.end(), images.first) != job.rig->cameras.end();
  });
}

/// The stations of a rig: images of its cameras whose patterns' wildcards stand for the same text.
Result<base::NetworkRig> rig_of(const Job& job, const DetectionTask& task) {
  std::map<std::string, std::string> patterns(job.network->images.begin(), job.network->images.end());
  std::map<std::string, std::vector<std::string>> stations;
  for (const ImageFile& file : task.images) {
    if (std::find(job.rig->cameras.begin(), job.rig->cameras.end(), file.camera) == job.rig->cameras.end()) continue;
    const std::string pattern = fs::path(patterns.at(file.camera)).filename().string();
    stations[wildcard_text(file.path.filename().string(), pattern)].push_back(file.name);
  }
  base::NetworkRig rig{job.rig->name, job.rig->cameras, {}};
  std::size_t complete = 0;
  for (auto& [text, images] : stations) {
    if (images.size() > rig.cameras.size()) {
      return bad_job(
          job, fmt::format("[rig] {} images belong to one station ('{}'): the patterns' wildcards must tell the stations apart",
                           images.size(), text));
    }
    complete += images.size() > 1 ? 1 : 0;
    rig.stations.push_back(std::move(images));
  }
  if (complete == 0) {
    return bad_job(job,
                   "[rig] no two images of its cameras belong together: what the wildcards of their patterns stand for must be "
                   "the same for images of one moment");
  }
  return rig;
}

/// Control points one by one from a list with sigmas, or together with their full covariance from the result of an adjustment.
Result<std::vector<base::ControlGroup>> control_of(const Job& job) {
  const fs::path path = job.resolve(*job.network->control);
  std::error_code ignored;
  std::vector<base::ControlGroup> groups;
  if (fs::is_directory(path, ignored)) {
    const auto points = base::points_from_network_json(path / "result.json");
    if (!points) return tl::unexpected(points.error());
    const auto covariance = base::read_covariance(path);
    if (!covariance) return tl::unexpected(covariance.error());
    base::ControlGroup group;
    std::vector<Eigen::Index> rows;
    group.xyz_mm.resize(static_cast<Eigen::Index>(3 * points->points.size()));
    for (const base::ReferencePoint& point : points->points) {
      group.xyz_mm.segment<3>(static_cast<Eigen::Index>(3 * group.ids.size())) = point.xyz_mm;
      group.ids.push_back(point.id);
      for (const char axis : {'x', 'y', 'z'}) {
        const std::string label = fmt::format("point {} {} [mm]", point.id, axis);
        const auto found = std::find(covariance->labels.begin(), covariance->labels.end(), label);
        if (found == covariance->labels.end()) {
          return bad_job(job, fmt::format("{}: covariance.json has no {}", path.string(), label));
        }
        rows.push_back(found - covariance->labels.begin());
      }
    }
    group.cov_mm2 = covariance->matrix(rows, rows);
    groups.push_back(std::move(group));
    return groups;
  }
  const auto list = base::read_point_list(path);
  if (!list) return tl::unexpected(list.error());
  for (const base::ReferencePoint& point : list->points) {
    if (!point.cov_mm2) {
      return bad_job(job, fmt::format("control point {} has no sigma in {}: known coordinates need one (0 holds them)",
                                      point.id, path.string()));
    }
    groups.push_back({{point.id}, point.xyz_mm, *point.cov_mm2});
  }
  return groups;
}

/// A list of points; its column axes names the coordinates that count ("xyz", "z", "yz"), all where there is none.
Result<std::vector<base::DatumPoint>> datum_of(const fs::path& path, const std::string& unit) {
  const auto list = base::read_point_list(path, {unit});
  if (!list) return tl::unexpected(list.error());
  std::map<int, std::array<bool, 3>> axes;
  const auto table = base::read_table(path);
  const auto column = table ? table->column("axes") : std::nullopt;
  for (std::size_t row = 0; column && row < table->rows.size(); ++row) {
    const std::string& text = table->rows[row][*column];
    if (text.find_first_not_of("xyz") != std::string::npos) {
      return base::fail(ErrorCode::kBadInput,
                        fmt::format("{}:{}: axes holds x, y and z of the coordinates that count, not '{}'", path.string(),
                                    table->lines[row], text));
    }
    const auto id = table->integer(row, *table->column("id"));
    if (!id) return tl::unexpected(id.error());
    const auto counts = [&](char axis) { return text.find(axis) != std::string::npos; };
    axes[*id] = {counts('x'), counts('y'), counts('z')};
  }
  std::vector<base::DatumPoint> points;
  for (const base::ReferencePoint& point : list->points) {
    base::DatumPoint& datum = points.emplace_back();
    datum.id = point.id;
    datum.xyz_mm = point.xyz_mm;
    if (const auto found = axes.find(point.id); found != axes.end()) datum.axes = found->second;
  }
  return points;
}

}  // namespace

Result<base::Network> network_of(const Job& job, const fs::path& detection) {
  auto task = detection_task(job);
  if (!task) return base::fail(std::move(task));
  const Photographs photographs(*task);
  auto images = detected_images(detection);
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
  auto cameras = start_cameras(job, network.images, photographs, detection.parent_path() / "calibrate");
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
  network.dot_diameter_mm = job.dot_diameter_mm;
  if (rig_took_part(job)) {
    auto rig = rig_of(job, *task);
    if (!rig) return base::fail(std::move(rig));
    network.rigs.push_back(std::move(*rig));
  }
  if (job.network->control) {
    auto control = control_of(job);
    if (!control) return base::fail(std::move(control));
    network.control = std::move(*control);
  }
  if (job.network->datum) {
    auto datum = datum_of(job.resolve(*job.network->datum), job.reference_unit);
    if (!datum) return base::fail(std::move(datum));
    network.datum = std::move(*datum);
  }
  return network;
}

Result<std::vector<base::ResultInput>> network_inputs(const Job& job, const fs::path& detection) {
  std::set<fs::path> files;
  const auto add = [&](const fs::path& path) {  // of a result what is read of it
    std::error_code ignored;
    if (!fs::is_directory(path, ignored)) {
      files.insert(path);
      return;
    }
    for (const char* name : {"result.json", "covariance.npy", "covariance.json"}) {
      if (fs::exists(path / name, ignored)) files.insert(path / name);
    }
  };
  for (const auto& [name, camera] : job.cameras) {
    if (camera.model) add(job.resolve(*camera.model));
  }
  if (job.network->scale_bars) files.insert(job.resolve(*job.network->scale_bars));
  if (job.network->scale_from) files.insert(job.resolve(*job.reference_points));
  if (job.network->control) add(job.resolve(*job.network->control));
  if (job.network->datum) files.insert(job.resolve(*job.network->datum));
  std::vector<base::ResultInput> inputs;
  auto observations = base::sha256_of_file(detection / "observations.csv");
  if (!observations) return base::fail(std::move(observations));
  inputs.push_back({kObservationsInput, std::move(*observations)});  // by its place in the job, wherever --out puts it
  const bool calibrated = std::any_of(job.network->images.begin(), job.network->images.end(), [&job](const auto& images) {
    return job.cameras.at(images.first).board_images.has_value();
  });
  if (calibrated) {
    const fs::path lenses = detection.parent_path() / "calibrate" / "result.json";
    auto hash = base::sha256_of_file(lenses);
    if (!hash) {
      return bad_job(job, fmt::format("cameras of [network] are calibrated by board_images, but there is no {} yet; `crosstie "
                                      "calibrate` or `crosstie run` makes it",
                                      lenses.string()));
    }
    inputs.push_back({"results/calibrate/result.json", std::move(*hash)});
  }
  for (const fs::path& file : files) {
    auto input = hashed_input(file, job.folder);
    if (!input) return base::fail(std::move(input));
    inputs.push_back(std::move(*input));
  }
  return inputs;
}

}  // namespace crosstie::app
