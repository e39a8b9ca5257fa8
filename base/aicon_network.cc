#include "base/aicon_network.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "base/aicon_files.h"
#include "base/file.h"
#include "base/table.h"

namespace crosstie::base {
namespace {

using Key = std::pair<int, int>;  // image, point

tl::unexpected<Error> bad(const std::filesystem::path& file, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(file), what));
}

Result<NetworkCamera> camera_of(const std::filesystem::path& file, const AiconCamera& camera) {
  if (camera.width_px <= 0 || camera.height_px <= 0 || !(camera.sensor_mm.minCoeff() > 0.0)) {
    return bad(file, fmt::format("camera {} has no sensor size", camera.id));
  }
  Eigen::VectorXd parameters(parameter_count(LensModel::kAicon));
  parameters << camera.c_mm, camera.principal_point_mm, camera.a1, camera.a2, camera.a3, camera.b1, camera.b2, camera.c1,
      camera.c2, camera.r0_mm, camera.sensor_mm, camera.width_px, camera.height_px;
  auto made = Camera::make(LensModel::kAicon, camera.width_px, camera.height_px, std::move(parameters));
  if (!made) return bad(file, fmt::format("camera {}: {}", camera.id, made.error().message));
  return NetworkCamera{std::to_string(camera.id), *std::move(made), true};
}

/// network_from_camera: AICON's camera looks along -z with y up, ours along +z with y down.
Pose pose_of(const AiconImage& image) {
  const Eigen::Vector3d& angles = image.omega_phi_kappa_rad;
  const Eigen::Quaterniond rotation = Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX()) *
                                      Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ());
  const Eigen::Quaterniond turn(0.0, 1.0, 0.0, 0.0);  // half a turn about x
  return {(rotation * turn).normalized(), image.position_mm};
}

/// Of an AICON lens, from its constants.
Eigen::Vector2d px_per_mm(const Camera& camera) {
  const Eigen::Vector2d sensor_mm = camera.parameters().segment<2>(11);
  return {camera.width_px() / sensor_mm.x(), camera.height_px() / sensor_mm.y()};
}

/// An observation at a place on the sensor (mm, y up).
Observation observation_of(const Camera& camera, const AiconImagePoint& point, const Eigen::Vector2d& sigma_px) {
  const Eigen::Vector2d per_mm = px_per_mm(camera);
  Observation observation;
  observation.id = point.point;
  observation.centre_px = {0.5 * (camera.width_px() - 1) + point.xy_mm.x() * per_mm.x(),
                           0.5 * (camera.height_px() - 1) - point.xy_mm.y() * per_mm.y()};
  observation.cov_px2 = sigma_px.cwiseAbs2().asDiagonal();
  observation.margin = 1.0;
  observation.status = ObservationStatus::kCoded;
  return observation;
}

/// Where overrides and exclusions stand; what is left at the end named nothing.
struct Special {
  std::map<Key, double> sigma_mm;
  std::set<Key> excluded;
  std::set<Key> found;

  explicit Special(const AiconNetworkOptions& options) {
    for (const auto& entry : options.overrides) sigma_mm[{entry.of.image, entry.of.point}] = entry.sigma_mm;
    for (const auto& entry : options.excluded) excluded.insert({entry.image, entry.point});
  }
  [[nodiscard]] Result<> all_found(const std::filesystem::path& file) const {
    std::set<Key> all = excluded;
    for (const auto& [key, sigma] : sigma_mm) all.insert(key);
    for (const Key& key : all) {
      if (!found.contains(key)) {
        return bad(file, fmt::format("point {} is no active image point of image {}, but an override or exclusion names it",
                                     key.second, key.first));
      }
    }
    return {};
  }
};

}  // namespace

Result<AiconProject> find_aicon_project(const std::filesystem::path& folder) {
  std::error_code error;
  std::map<std::string, std::vector<std::filesystem::path>> by_ending;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    by_ending[it->path().extension().string()].push_back(it->path());
  }
  if (error) return fail(ErrorCode::kFileSystem, fmt::format("cannot read {}: {}", shown(folder), error.message()));
  AiconProject project;
  for (const auto& [ending, place] : {std::pair{".phc", &project.image_points},
                                      {".obc", &project.object_points},
                                      {".ior", &project.cameras},
                                      {".eor", &project.images},
                                      {".scale", &project.scales}}) {
    const auto& found = by_ending[ending];
    if (found.size() != 1) {
      return bad(folder, fmt::format("an AICON project has one {} file, here are {}", ending, found.size()));
    }
    *place = found.front();
  }
  return project;
}

Result<Network> read_aicon_network(const AiconProject& project, const AiconNetworkOptions& options) {
  const auto image_points = read_aicon_image_points(project.image_points);
  if (!image_points) return tl::unexpected(image_points.error());
  const auto object_points = read_aicon_object_points(project.object_points);
  if (!object_points) return tl::unexpected(object_points.error());
  const auto cameras = read_aicon_cameras(project.cameras);
  if (!cameras) return tl::unexpected(cameras.error());
  const auto images = read_aicon_images(project.images);
  if (!images) return tl::unexpected(images.error());
  const auto scales = read_aicon_scales(project.scales);
  if (!scales) return tl::unexpected(scales.error());

  Network network;
  std::map<int, std::size_t> camera_of_id;
  for (const AiconCamera& entry : *cameras) {
    auto camera = camera_of(project.cameras, entry);
    if (!camera) return fail(std::move(camera));
    camera_of_id[entry.id] = network.cameras.size();
    network.cameras.push_back(*std::move(camera));
  }
  std::map<int, std::size_t> image_of_id;
  for (const AiconImage& entry : *images) {
    const auto camera = camera_of_id.find(entry.camera);
    if (camera == camera_of_id.end()) {
      return bad(project.images, fmt::format("image {} is of camera {}, which {} does not describe", entry.image, entry.camera,
                                             shown(project.cameras)));
    }
    if (entry.rotation_order != 0) {
      return bad(project.images, fmt::format("image {}: rotation order {} is not read, only 0 (omega, phi, kappa)", entry.image,
                                             entry.rotation_order));
    }
    const NetworkCamera& taken_by = network.cameras[camera->second];
    ImageObservations image;
    image.image = std::to_string(entry.image);
    image.camera = taken_by.name;
    image.width_px = taken_by.camera.width_px();
    image.height_px = taken_by.camera.height_px();
    image_of_id[entry.image] = network.images.size();
    network.images.push_back(std::move(image));
    if (options.start_values) network.start_poses.push_back({std::to_string(entry.image), pose_of(entry)});
  }
  std::set<int> inactive;
  for (const AiconObjectPoint& entry : *object_points) {
    if (!entry.active) {
      inactive.insert(entry.id);
      continue;
    }
    network.datum.push_back({entry.id, entry.xyz_mm});
    if (options.start_values) network.start_points.push_back({entry.id, entry.xyz_mm, {}});
  }

  Special special(options);
  for (const AiconImagePoint& entry : *image_points) {
    if (!entry.active || inactive.contains(entry.point)) continue;
    const auto image = image_of_id.find(entry.image);
    if (image == image_of_id.end()) {
      return bad(project.image_points, fmt::format("image {} is not one of {}", entry.image, shown(project.images)));
    }
    const Key key{entry.image, entry.point};
    special.found.insert(key);
    if (special.excluded.contains(key)) continue;
    ImageObservations& observations = network.images[image->second];
    const Camera& camera = network.cameras[camera_of_id.at((*images)[image->second].camera)].camera;
    const Eigen::Vector2d per_mm = px_per_mm(camera);
    const auto own = special.sigma_mm.find(key);
    Eigen::Vector2d sigma_px =
        options.sigma_px > 0.0 ? Eigen::Vector2d::Constant(options.sigma_px) : Eigen::Vector2d(options.sigma_mm * per_mm);
    if (own != special.sigma_mm.end()) sigma_px = own->second * per_mm;
    observations.observations.push_back(observation_of(camera, entry, sigma_px));
  }
  if (auto ok = special.all_found(project.image_points); !ok) return fail(std::move(ok));

  for (const AiconScale& entry : *scales) {
    if (!entry.active) continue;
    ScaleBar bar;
    bar.id_a = entry.id_a;
    bar.id_b = entry.id_b;
    bar.length_mm = entry.length_mm;
    bar.sigma_mm = entry.sigma_mm;
    bar.role = entry.sigma_mm > 0.0 ? ScaleBarRole::kUsed : ScaleBarRole::kDefines;
    bar.certificate = entry.name;
    network.scale_bars.push_back(std::move(bar));
  }
  return network;
}

Result<std::vector<AiconNetworkOptions::Sigma>> read_image_point_sigmas(const std::filesystem::path& path) {
  const auto table = read_table(path);
  if (!table) return tl::unexpected(table.error());
  const auto sigma = table->column("sigma_mm");
  if (!sigma) return bad(path, "the columns image, id and sigma_mm are needed");
  auto ids = read_image_point_ids(path);
  if (!ids) return fail(std::move(ids));
  std::vector<AiconNetworkOptions::Sigma> result;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto value = table->number(row, *sigma);
    if (!value) return tl::unexpected(value.error());
    if (!(*value > 0.0))
      return fail(ErrorCode::kBadInput, fmt::format("{}:{}: a sigma is positive", shown(path), table->lines[row]));
    result.push_back({(*ids)[row], *value});
  }
  return result;
}

Result<std::vector<AiconNetworkOptions::ImagePointId>> read_image_point_ids(const std::filesystem::path& path) {
  const auto table = read_table(path);
  if (!table) return tl::unexpected(table.error());
  const auto image = table->column("image");
  const auto id = table->column("id");
  if (!image || !id) return bad(path, "the columns image and id are needed");
  std::vector<AiconNetworkOptions::ImagePointId> result;
  std::set<Key> seen;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto image_number = table->integer(row, *image);
    if (!image_number) return tl::unexpected(image_number.error());
    const auto point = table->integer(row, *id);
    if (!point) return tl::unexpected(point.error());
    const auto refuse = [&](std::string_view what) {
      return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), table->lines[row], what));
    };
    if (*image_number < 0 || *point < 0) return refuse("ids are 0 or larger");
    if (!seen.emplace(*image_number, *point).second) return refuse("this image point stands already above");
    result.push_back({*image_number, *point});
  }
  return result;
}

}  // namespace crosstie::base
