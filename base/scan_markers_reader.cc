#include "base/scan_markers_reader.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/json_file.h"

namespace crosstie::base {

using detail::Json;

Result<std::vector<ReferencePoint>> read_scan_markers(const std::filesystem::path& folder) {
  const auto path = folder / "result.json";
  const auto json = read_json(path);
  if (!json) return tl::unexpected<Error>(json.error());
  const auto bad = [&](std::string_view what) { return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), what)); };
  std::vector<ReferencePoint> markers;
  try {
    detail::check_verb(*json, "scan");
    if (!json->contains("markers")) return markers;
    for (const Json& one : json->at("markers")) {
      ReferencePoint& marker = markers.emplace_back();
      marker.id = one.at("id");
      marker.xyz_mm = detail::numbers(one.at("xyz_mm"), 3);
      marker.cov_mm2 = Eigen::Matrix3d(detail::symmetric(one.at("cov_mm2"), 3));
    }
  } catch (const Json::exception& error) {
    return bad(error.what());
  } catch (const detail::Unreadable& error) {
    return bad(error.what());
  }
  return markers;
}

}  // namespace crosstie::base
