// What convert reads: by ending and content.

#include <fmt/core.h>

#include "app/exchange.h"
#include "app/head_files.h"
#include "base/calibration_reader.h"
#include "base/camera_file.h"
#include "base/commissioning_reader.h"
#include "base/envelope_reader.h"
#include "base/file.h"
#include "base/kalibr.h"
#include "base/network_reader.h"
#include "base/pcd.h"
#include "base/ply.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

template <typename T>
Result<Exchanged> as_exchanged(Result<T> read) {
  if (!read) return base::fail(std::move(read));
  return Exchanged(*std::move(read));
}

Exchanged of_head(base::Head head) {
  return std::vector<PlacedCamera>{{std::move(head.left_name), std::move(head.left), base::Pose{}},
                                   {std::move(head.right_name), std::move(head.right), head.right_from_left}};
}

Result<Exchanged> read_calibrated(const fs::path& folder) {
  auto calibration = base::read_calibration(folder);
  if (!calibration) return tl::unexpected(calibration.error());
  if (calibration->rig && calibration->cameras.size() == 2) {
    auto head = head_of(*calibration);
    if (!head) return base::fail(std::move(head));
    return of_head(*std::move(head));
  }
  std::vector<PlacedCamera> cameras;
  for (base::CalibratedCamera& one : calibration->cameras) cameras.push_back({one.name, std::move(one.camera), std::nullopt});
  return Exchanged(std::move(cameras));
}

Result<Exchanged> read_result(const fs::path& folder) {
  const auto envelope = base::read_envelope(folder);
  if (!envelope) return tl::unexpected(envelope.error());
  if (envelope->verb == "adjust") return as_exchanged(base::read_adjusted_network(folder));
  if (envelope->verb == "calibrate") return read_calibrated(folder);
  if (envelope->verb == "commission") {
    auto commissioning = base::read_commissioning(folder);
    if (!commissioning) return tl::unexpected(commissioning.error());
    return of_head(std::move(commissioning->head));
  }
  return base::fail(ErrorCode::kUsage, fmt::format("{} is a result of {}, whose files convert as they stand; possible: {}",
                                                   base::shown(folder), envelope->verb, kConversions));
}

Result<Exchanged> read_folder(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "result.json", ignored)) return read_result(folder);
  if (base::colmap_format_of(folder)) return as_exchanged(base::read_colmap_model(folder));
  return base::fail(
      ErrorCode::kUsage,
      fmt::format("{} is neither a result of adjust, calibrate or commission (result.json) nor a COLMAP model (cameras, "
                  "images and points3D as .txt or .bin); possible: {}",
                  base::shown(folder), kConversions));
}

/// A camera, or all of a chain with the pose of each in the first one's frame, where the chain says it.
Result<Exchanged> read_cameras(const fs::path& path) {
  constexpr std::size_t kMostBytes = std::size_t{256} << 20;  // mrcal's models may carry the whole calibration problem
  const auto text = base::read_file(path, kMostBytes);
  if (!text) return tl::unexpected(text.error());
  if (path.extension() == ".cameramodel" || !base::is_kalibr_chain(*text)) {
    auto camera = base::read_camera(path);
    if (!camera) return base::fail(std::move(camera));
    return Exchanged(std::vector<PlacedCamera>{{"", *std::move(camera), std::nullopt}});
  }
  auto chain = base::parse_kalibr_chain(path, *text);
  if (!chain) return base::fail(std::move(chain));
  std::vector<PlacedCamera> cameras;
  for (base::KalibrCamera& one : *chain) {
    std::optional<base::Pose> pose;
    if (cameras.empty()) pose = base::Pose{};
    if (!cameras.empty() && cameras.back().camera_from_rig && one.camera_from_previous)
      pose = *one.camera_from_previous * *cameras.back().camera_from_rig;
    cameras.push_back({std::move(one.name), std::move(one.camera), pose});
  }
  return Exchanged(std::move(cameras));
}

Result<Exchanged> read_cloud(const fs::path& path, const std::string& unit) {
  auto cloud = path.extension() == ".pcd" ? base::read_pcd(path) : base::read_ply(path);
  if (!cloud) return base::fail(std::move(cloud));
  const double unit_mm = unit == "m" ? 1000.0 : unit == "inch" ? 25.4 : 1.0;
  for (Eigen::Vector3d& point : cloud->points) point *= unit_mm;
  for (Eigen::Matrix3d& cov : cloud->cov_mm2) cov *= unit_mm * unit_mm;
  return Exchanged(*std::move(cloud));
}

}  // namespace

Result<Exchanged> read_exchanged(const fs::path& path, const std::string& unit) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return read_folder(path);
  const std::string ending = path.extension().string();
  if (path.filename() == "result.json") return read_result(path.has_parent_path() ? path.parent_path() : ".");
  if (ending == ".json") return as_exchanged(base::read_tool_path_json(path));
  if (ending == ".cameramodel" || ending == ".yaml" || ending == ".yml") return read_cameras(path);
  if (ending == ".ply" || ending == ".pcd") return read_cloud(path, unit);
  if (ending == ".csv" || ending == ".txt" || ending == ".obc") {
    auto list = base::read_point_list(path, {unit});
    if (!list) return base::fail(std::move(list));
    return Exchanged(FramedPoints{"", *std::move(list)});
  }
  return base::fail(ErrorCode::kUsage, fmt::format("cannot convert from {}; possible: {}", base::shown(path), kConversions));
}

}  // namespace crosstie::app
