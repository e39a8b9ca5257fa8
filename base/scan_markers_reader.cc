#include "base/scan_markers_reader.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"

namespace crosstie::base {

using detail::Json;

namespace {

std::vector<ReferencePoint> markers_of(const Json& json) {
  detail::check_verb(json, "scan");
  std::vector<ReferencePoint> markers;
  if (!json.contains("markers")) return markers;
  for (const Json& one : json.at("markers")) {
    ReferencePoint& marker = markers.emplace_back();
    marker.id = one.at("id");
    marker.xyz_mm = detail::numbers(one.at("xyz_mm"), 3);
    marker.cov_mm2 = Eigen::Matrix3d(detail::symmetric(one.at("cov_mm2"), 3));
  }
  return markers;
}

}  // namespace

Result<std::vector<ReferencePoint>> read_scan_markers(const std::filesystem::path& folder) {
  return detail::read_result(folder, markers_of);
}

}  // namespace crosstie::base
