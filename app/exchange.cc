#include "app/exchange.h"

#include <cmath>
#include <limits>

#include <fmt/core.h>

#include "base/aicon_files.h"
#include "base/cloud.h"
#include "base/file.h"
#include "base/kalibr.h"
#include "base/network_reader.h"
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

bool is_camera_file(const fs::path& path) {
  return path.extension() == ".cameramodel" || path.extension() == ".yaml" || path.extension() == ".yml";
}

Result<Exchanged> read_folder(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "result.json", ignored)) return as_exchanged(base::read_adjusted_network(folder));
  if (base::colmap_format_of(folder)) return as_exchanged(base::read_colmap_model(folder));
  return base::fail(
      ErrorCode::kUsage,
      fmt::format("{} is neither a result of adjust (result.json) nor a COLMAP model (cameras, images and points3D "
                  "as .txt or .bin); possible: {}",
                  base::shown(folder), kConversions));
}

/// Ids of a COLMAP model become those of a list.
Result<FramedPoints> list_of(const base::ColmapModel& model, double unit_mm) {
  FramedPoints points;
  for (const base::ColmapPoint& point : model.points) {
    if (point.id > static_cast<std::uint64_t>(std::numeric_limits<int>::max())) {
      return base::fail(ErrorCode::kBadInput, fmt::format("point {} of the COLMAP model: ids of lists end at {}", point.id,
                                                          std::numeric_limits<int>::max()));
    }
    points.list.points.push_back({static_cast<int>(point.id), point.xyz * unit_mm, std::nullopt});
  }
  return points;
}

FramedPoints list_of(const base::AdjustedNetwork& network) {
  FramedPoints points{"network", {}};
  for (const base::AdjustedPoint& point : network.points) points.list.points.push_back({point.id, point.xyz_mm, point.cov_mm2});
  return points;
}

base::Cloud cloud_of(const FramedPoints& points) {
  base::Cloud cloud;
  cloud.frame = points.frame;
  base::CloudField id{"id", {}};
  base::CloudField sigma{"sigma_mm", {}};
  for (const base::ReferencePoint& point : points.list.points) {
    cloud.points.push_back(point.xyz_mm);
    id.values.push_back(point.id);
    if (!point.cov_mm2) continue;
    cloud.cov_mm2.push_back(*point.cov_mm2);
    sigma.values.push_back(std::sqrt(point.cov_mm2->trace()));
  }
  cloud.fields.push_back(std::move(id));
  // A cloud's lists are as long as its points: covariances only where every point has one.
  if (cloud.cov_mm2.size() == cloud.points.size()) {
    cloud.fields.push_back(std::move(sigma));
  } else {
    cloud.cov_mm2.clear();
  }
  return cloud;
}

}  // namespace

Result<Exchanged> read_exchanged(const fs::path& path, const std::string& unit, const std::string& camera) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return read_folder(path);
  if (path.extension() == ".json") {
    if (path.filename() != "result.json") {
      return base::fail(ErrorCode::kUsage, fmt::format("{} is no result.json; possible: {}", base::shown(path), kConversions));
    }
    return as_exchanged(base::read_adjusted_network(path.has_parent_path() ? path.parent_path() : "."));
  }
  if (is_camera_file(path)) return as_exchanged(base::read_named_camera(path, camera));
  if (path.extension() == ".csv" || path.extension() == ".txt" || path.extension() == ".obc") {
    auto list = base::read_point_list(path, {unit});
    if (!list) return base::fail(std::move(list));
    return Exchanged(FramedPoints{"", *std::move(list)});
  }
  return base::fail(ErrorCode::kUsage, fmt::format("cannot convert from {}; possible: {}", base::shown(path), kConversions));
}

Result<std::optional<FramedPoints>> points_of(const Exchanged& content, double colmap_unit_mm) {
  if (const auto* points = std::get_if<FramedPoints>(&content)) return std::optional(*points);
  if (const auto* network = std::get_if<base::AdjustedNetwork>(&content)) return std::optional(list_of(*network));
  if (const auto* model = std::get_if<base::ColmapModel>(&content)) {
    auto points = list_of(*model, colmap_unit_mm);
    if (!points) return base::fail(std::move(points));
    return std::optional(*std::move(points));
  }
  return std::nullopt;
}

std::optional<base::ColmapModel> colmap_of(const Exchanged& content) {
  if (const auto* model = std::get_if<base::ColmapModel>(&content)) return *model;
  if (const auto* network = std::get_if<base::AdjustedNetwork>(&content)) return base::colmap_model_of(*network);
  return std::nullopt;
}

Result<> write_points(const fs::path& path, const FramedPoints& points) {
  if (path.extension() == ".obc") return base::write_aicon_object_points(path, points.list);
  if (path.extension() == ".ply") return base::write_ply(path, cloud_of(points));
  return base::write_point_list(path, points.list);
}

}  // namespace crosstie::app
