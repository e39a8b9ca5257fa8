#include <cmath>

#include <fmt/format.h>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/tool_path.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::Unreadable;

constexpr double kUnitLength = 1e-6;  ///< how far a direction's length may be from 1

double finite(const Json& json) {
  const auto value = json.get<double>();
  if (!std::isfinite(value)) throw Unreadable("a number that is not finite");
  return value;
}

Eigen::Vector3d direction(const Json& json, const char* name) {
  const Eigen::Vector3d v = detail::numbers(json, 3);
  if (!(std::abs(v.norm() - 1.0) < kUnitLength)) throw Unreadable(fmt::format("{} has no length of 1", name));
  return v;
}

PathSource source_of(const std::string& name) {
  for (const auto source : {PathSource::kMeasured, PathSource::kBlend, PathSource::kNominal}) {
    if (path_source_name(source) == name) return source;
  }
  throw Unreadable(fmt::format("the source '{}' is not known", name.substr(0, 40)));
}

ToolPathPoint point_of(const Json& json) {
  ToolPathPoint p;
  p.s_mm = finite(json.at("s_mm"));
  p.time_s = finite(json.at("time_s"));
  p.point_mm = detail::numbers(json.at("xyz_mm"), 3);
  p.tangent = direction(json.at("tangent"), "tangent");
  p.normal = direction(json.at("normal"), "normal");
  p.torch = direction(json.at("torch"), "torch");
  p.speed_mm_per_s = finite(json.at("speed_mm_per_s"));
  const Eigen::Vector2d correction = detail::numbers(json.at("correction_uv_mm"), 2);
  const Eigen::Vector2d sigma = detail::numbers(json.at("sigma_uv_mm"), 2);
  p.correction_u_mm = correction.x();
  p.correction_v_mm = correction.y();
  p.sigma_u_mm = sigma.x();
  p.sigma_v_mm = sigma.y();
  p.sigma_torch_rad = detail::numbers(json.at("sigma_torch_rad"), 2);
  p.source = source_of(json.at("source").get<std::string>());
  return p;
}

ToolPath path_of(const Json& json) {
  if (json.at("format") != "crosstie-path/1") throw Unreadable("its format is not crosstie-path/1");
  if (json.at("unit") != "mm") throw Unreadable("its unit is not mm");
  ToolPath path;
  path.frame = json.at("frame").get<std::string>();
  path.closed = json.at("closed").get<bool>();
  path.length_mm = finite(json.at("length_mm"));
  path.duration_s = finite(json.at("duration_s"));
  path.bevel_rad = finite(json.at("bevel_rad"));
  path.lead_rad = finite(json.at("lead_rad"));
  path.standoff_mm = finite(json.at("standoff_mm"));
  path.offset_mm = finite(json.at("offset_mm"));
  for (const Json& gap : json.at("gaps")) {
    path.gaps.push_back({finite(gap.at("from_mm")), finite(gap.at("length_mm")), gap.at("reason").get<std::string>()});
  }
  for (const Json& point : json.at("points")) path.points.push_back(point_of(point));
  if (path.points.size() < 2) throw Unreadable("a path has two points at least");
  return path;
}

}  // namespace

Result<ToolPath> read_tool_path_json(const std::filesystem::path& path) {
  const auto json = read_json(path);
  if (!json) return tl::unexpected(json.error());
  try {
    return path_of(*json);
  } catch (const Json::exception& error) {
    return detail::bad_result(path, error.what());
  } catch (const Unreadable& error) {
    return detail::bad_result(path, error.what());
  }
}

}  // namespace crosstie::base
