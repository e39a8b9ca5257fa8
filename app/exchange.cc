#include "app/exchange.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>

#include "base/file.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

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

Result<FramedPoints> list_of(const base::Cloud& cloud) {
  const auto ids = std::find_if(cloud.fields.begin(), cloud.fields.end(), [](const auto& field) { return field.name == "id"; });
  if (ids == cloud.fields.end())
    return base::fail(ErrorCode::kUsage,
                      "the points of this cloud have no ids (a field id); .ply, .pcd, .csv and .txt do without");
  FramedPoints points{cloud.frame, {}};
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const double id = ids->values[i];
    if (id != std::floor(id) || id < 0.0 || id > std::numeric_limits<int>::max())
      return base::fail(ErrorCode::kBadInput, fmt::format("point {} of the cloud: {} is no id", i, id));
    points.list.points.push_back({static_cast<int>(id), cloud.points[i], std::nullopt});
    if (!cloud.cov_mm2.empty()) points.list.points.back().cov_mm2 = cloud.cov_mm2[i];
  }
  auto& list = points.list.points;
  std::sort(list.begin(), list.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  const auto twice = std::adjacent_find(list.begin(), list.end(), [](const auto& a, const auto& b) { return a.id == b.id; });
  if (twice != list.end())
    return base::fail(ErrorCode::kBadInput, fmt::format("the cloud has two points with id {}", twice->id));
  return points;
}

base::Cloud cloud_of_list(const FramedPoints& points) {
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

std::vector<PlacedCamera> cameras_of(const base::AdjustedNetwork& network) {
  std::vector<PlacedCamera> cameras;
  for (const base::AdjustedCamera& one : network.cameras) cameras.push_back({one.name, one.camera, std::nullopt});
  return cameras;
}

}  // namespace

Result<std::optional<FramedPoints>> points_of(const Exchanged& content, double colmap_unit_mm) {
  const auto some = [](Result<FramedPoints> points) -> Result<std::optional<FramedPoints>> {
    if (!points) return base::fail(std::move(points));
    return std::optional(*std::move(points));
  };
  if (const auto* points = std::get_if<FramedPoints>(&content)) return std::optional(*points);
  if (const auto* network = std::get_if<base::AdjustedNetwork>(&content)) return std::optional(list_of(*network));
  if (const auto* model = std::get_if<base::ColmapModel>(&content)) return some(list_of(*model, colmap_unit_mm));
  if (const auto* cloud = std::get_if<base::Cloud>(&content)) return some(list_of(*cloud));
  return std::nullopt;
}

Result<std::optional<base::Cloud>> cloud_of(const Exchanged& content, double colmap_unit_mm) {
  if (const auto* cloud = std::get_if<base::Cloud>(&content)) return std::optional(*cloud);
  const auto points = points_of(content, colmap_unit_mm);
  if (!points) return tl::unexpected(points.error());
  if (!*points) return std::nullopt;
  return std::optional(cloud_of_list(**points));
}

std::optional<base::ColmapModel> colmap_of(const Exchanged& content) {
  if (const auto* model = std::get_if<base::ColmapModel>(&content)) return *model;
  if (const auto* network = std::get_if<base::AdjustedNetwork>(&content)) return base::colmap_model_of(*network);
  return std::nullopt;
}

std::vector<PlacedCamera> cameras_of(const Exchanged& content) {
  if (const auto* cameras = std::get_if<std::vector<PlacedCamera>>(&content)) return *cameras;
  if (const auto* network = std::get_if<base::AdjustedNetwork>(&content)) return cameras_of(*network);
  std::vector<PlacedCamera> cameras;
  if (const auto* model = std::get_if<base::ColmapModel>(&content)) {
    for (const base::ColmapCamera& one : model->cameras) cameras.push_back({std::to_string(one.id), one.camera, std::nullopt});
  }
  return cameras;
}

Result<PlacedCamera> chosen_camera(const std::vector<PlacedCamera>& cameras, const std::string& name) {
  if (cameras.size() == 1 && (name.empty() || cameras.front().name.empty())) return cameras.front();
  std::string names;
  for (const PlacedCamera& one : cameras) {
    if (one.name == name) return one;
    names += (names.empty() ? "" : ", ") + one.name;
  }
  return base::fail(ErrorCode::kUsage, fmt::format("{}; --camera is one of {}",
                                                   name.empty() ? std::string("several cameras") : "no camera " + name, names));
}

}  // namespace crosstie::app
