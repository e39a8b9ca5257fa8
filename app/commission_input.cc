#include "app/commission_input.h"

#include <algorithm>

#include <fmt/core.h>

#include "app/current.h"
#include "app/detected_images.h"
#include "app/head_files.h"
#include "app/probed_spheres.h"
#include "app/steps.h"
#include "base/calibration_reader.h"
#include "base/file.h"
#include "base/npy.h"
#include "base/point_list.h"
#include "base/sphere_list.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

tl::unexpected<base::Error> bad_job(const Job& job, const std::string& message) {
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", job.file.string(), message));
}

Result<base::Head> calibrated_head(const Job& job, const CommissionSources& sources) {
  const auto folder = calibration_folder(job, sources.calibration);
  if (!folder) return tl::unexpected(folder.error());
  const auto calibration = base::read_calibration(*folder);
  if (!calibration) return tl::unexpected(calibration.error());
  const auto [left, right] = head_cameras(job);
  if (!calibration->rig || calibration->rig->left != left || calibration->rig->right != right) {
    return bad_job(job, fmt::format("{} holds no rig of {} and {}: calibrate both by pairs of images of the same moment",
                                    folder->string(), left, right));
  }
  return head_of(*calibration);
}

/// The points of the job's own adjustment with their full covariance.
Result<std::pair<std::vector<base::ReferencePoint>, Eigen::MatrixXd>> adjusted_points(const fs::path& folder) {
  const auto list = base::points_from_network_json(folder / "result.json");
  if (!list) return tl::unexpected(list.error());
  const auto covariance = base::read_covariance(folder);
  if (!covariance) return tl::unexpected(covariance.error());
  std::vector<base::ReferencePoint> points;
  std::vector<Eigen::Index> rows;
  for (const base::ReferencePoint& point : list->points) {
    if (!point.has_own_id) continue;
    points.push_back(point);
    for (const char axis : {'x', 'y', 'z'}) {
      const std::string label = fmt::format("point {} {} [mm]", point.id, axis);
      const auto found = std::find(covariance->labels.begin(), covariance->labels.end(), label);
      if (found == covariance->labels.end()) {
        return base::fail(ErrorCode::kBadInput,
                          fmt::format("{}: there is no {}", base::shown(folder / "covariance.json"), label));
      }
      rows.push_back(found - covariance->labels.begin());
    }
  }
  return std::pair(std::move(points), Eigen::MatrixXd(covariance->matrix(rows, rows)));
}

Result<base::Cross> cross_of(const Job& job, const CommissionSources& sources) {
  base::Cross cross;
  auto spheres = base::read_reference_spheres(job.resolve(*job.cross->spheres));
  if (!spheres) return base::fail(std::move(spheres));
  cross.spheres = std::move(*spheres);
  if (job.cross->points) {
    auto list = base::read_point_list(job.resolve(*job.cross->points));
    if (!list) return base::fail(std::move(list));
    cross.markers = std::move(list->points);
  } else {
    auto points = adjusted_points(sources.adjustment);
    if (!points) return base::fail(std::move(points));
    cross.markers = std::move(points->first);
    const Eigen::Index of_markers = points->second.rows();
    const auto of_spheres = static_cast<Eigen::Index>(3 * cross.spheres.size());
    cross.cov_mm2 = Eigen::MatrixXd::Zero(of_markers + of_spheres, of_markers + of_spheres);
    cross.cov_mm2.topLeftCorner(of_markers, of_markers) = points->second;
    for (std::size_t i = 0; i < cross.spheres.size(); ++i) {
      const Eigen::Index at = of_markers + static_cast<Eigen::Index>(3 * i);
      cross.cov_mm2.block<3, 3>(at, at) = cross.spheres[i].cov_mm2;
    }
  }
  cross.measured_at_c = job.cross->points_temperature_c.value_or(20.0);
  cross.temperature_c = job.cross->thermal.temperature_c;
  cross.temperature_sigma_c = job.cross->thermal.temperature_sigma_c;
  cross.cte_per_k = job.cross->thermal.cte_per_k;
  cross.cte_sigma_per_k = job.cross->thermal.cte_sigma_per_k;
  cross.certificate = job.cross->certificate;
  return cross;
}

}  // namespace

std::pair<std::string, std::string> head_cameras(const Job& job) {
  if (job.rig && job.rig->cameras.size() >= 2) return {job.rig->cameras[0], job.rig->cameras[1]};
  return {"left", "right"};
}

bool is_calibrated_here(const Job& job) {
  const auto [left, right] = head_cameras(job);
  const std::vector<std::string> calibrated = job.board_cameras();
  return std::find(calibrated.begin(), calibrated.end(), left) != calibrated.end() &&
         std::find(calibrated.begin(), calibrated.end(), right) != calibrated.end();
}

Result<fs::path> calibration_folder(const Job& job, const fs::path& own) {
  if (is_calibrated_here(job)) return own;
  const auto [left, right] = head_cameras(job);
  const auto model_of = [&](const std::string& name) -> std::optional<fs::path> {
    const auto found = job.cameras.find(name);
    if (found == job.cameras.end() || !found->second.model) return std::nullopt;
    const fs::path path = job.resolve(*found->second.model);
    return path.filename() == "result.json" ? path.parent_path() : path;
  };
  const auto folder = model_of(left);
  std::error_code ignored;
  if (!folder || folder != model_of(right) || !fs::is_directory(*folder, ignored)) {
    return bad_job(job, fmt::format("the calibration of the head is needed with the covariance of its rig: board_images in "
                                    "[camera.{}] and [camera.{}], or in both as model the same result folder of calibrate",
                                    left, right));
  }
  return *folder;
}

Result<> check_commission(const Job& job) {
  if (!job.cross || !job.cross->spheres) {
    return bad_job(job, "commission needs [cross] with points and spheres: its markers and the balls that the machine probes");
  }
  if (!job.machine || (!job.machine->probed_spheres && !job.machine->probe_hits)) {
    return bad_job(job, "commission needs [machine] with probed_spheres or probe_hits: they tie the cross to the machine");
  }
  const auto [left, right] = head_cameras(job);
  bool any = false;
  for (const JobStation& station : job.stations) {
    for (const auto& [camera, image] : station.cross) {
      any = true;
      if (camera == left || camera == right) continue;
      return bad_job(job,
                     fmt::format("station {}: the head's cameras are {} and {}, not {}", station.name, left, right, camera));
    }
  }
  if (!any) return bad_job(job, "commission needs [[station]] tables with photographs of the cross");
  return {};
}

Result<bundle::CommissionInput> commission_input(const Job& job, const CommissionSources& sources,
                                                 std::vector<base::Warning>& warnings) {
  auto head = calibrated_head(job, sources);
  if (!head) return base::fail(std::move(head));
  auto cross = cross_of(job, sources);
  if (!cross) return base::fail(std::move(cross));
  auto probed = probed_spheres(job, cross->spheres, warnings);
  if (!probed) return base::fail(std::move(probed));
  auto images = detected_images(sources.detection);
  if (!images) return base::fail(std::move(images));
  bundle::CommissionInput input{.head = std::move(*head),
                                .cross = std::move(*cross),
                                .probed = std::move(*probed),
                                .stations = {},
                                .images = std::move(*images)};
  for (base::ImageObservations& image : input.images) image.family = job.family;
  const auto [left, right] = head_cameras(job);
  for (const JobStation& station : job.stations) {
    base::Station one{.name = station.name, .axis_mm = station.axis_mm, .left = {}, .right = {}};
    for (const auto& [camera, file] : station.cross) {
      const std::string name = station_image(station.name, camera);
      (camera == left ? one.left : one.right) = name;
      for (base::ImageObservations& image : input.images) {
        const bool own = image.image == name;
        if (!own && !image.image.starts_with(name + "-")) continue;
        image.camera = camera;
        if (!own) input.repeated.push_back({name, image.image});
      }
    }
    if (!station.cross.empty()) input.stations.push_back(std::move(one));
  }
  if (job.machine->axis_sigma_mm) input.reading_sigma_mm = *job.machine->axis_sigma_mm;
  return input;
}

Result<std::vector<base::ResultInput>> commission_inputs(const Job& job, const CommissionSources& sources) {
  struct File {
    fs::path path;
    std::string place;  ///< in the job, for results; empty: relative to it
  };
  std::vector<File> files = {
      {sources.detection / "observations.csv", "results/detect-stations/observations.csv"},
      {job.resolve(*job.cross->spheres), ""},
      {job.resolve(job.machine->probed_spheres ? *job.machine->probed_spheres : *job.machine->probe_hits), ""}};
  const auto calibration = calibration_folder(job, sources.calibration);
  if (!calibration) return tl::unexpected(calibration.error());
  for (const char* name : {"result.json", "covariance.npy", "covariance.json"}) {
    files.push_back({*calibration / name, is_calibrated_here(job) ? fmt::format("results/calibrate/{}", name) : ""});
    if (!job.cross->points) files.push_back({sources.adjustment / name, fmt::format("results/adjust/{}", name)});
  }
  if (job.cross->points) files.push_back({job.resolve(*job.cross->points), ""});
  std::vector<base::ResultInput> inputs;
  for (const File& file : files) {
    auto input = hashed_input(file.path, job.folder);
    if (!input) return base::fail(std::move(input));
    if (!file.place.empty()) input->path = file.place;
    inputs.push_back(std::move(*input));
  }
  return inputs;
}

}  // namespace crosstie::app
