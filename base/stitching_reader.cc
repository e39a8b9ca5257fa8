#include "base/stitching_reader.h"

#include <algorithm>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/npy.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::numbers;
using detail::symmetric;
using detail::Unreadable;

Segment segment_of(const Json& json) {
  Segment segment;
  const std::string kind = json.at("kind");
  bool known = false;
  for (const auto candidate : {Segment::Kind::kNone, Segment::Kind::kPlane, Segment::Kind::kCylinder, Segment::Kind::kCone}) {
    if (kind != segment_name(candidate)) continue;
    segment.kind = candidate;
    known = true;
  }
  if (!known) throw Unreadable(fmt::format("a segment called '{}'", kind));
  segment.point_mm = numbers(json.at("point_mm"), 3);
  segment.direction = numbers(json.at("direction"), 3);
  segment.radius_mm = json.at("radius_mm");
  segment.half_angle_rad = json.at("half_angle_rad");
  segment.rms_mm = json.at("rms_mm");
  segment.given = json.at("given");
  return segment;
}

StitchedStation station_of(const Json& json) {
  StitchedStation station;
  station.name = json.at("name");
  if (const Json& axis = json.at("axis_mm"); !axis.is_null()) station.axis_mm = axis.get<double>();
  station.machine_from_rig = detail::pose_of(json.at("machine_from_rig"));
  station.cov = symmetric(json.at("cov"), 6);
  station.centre_mm = numbers(json.at("centre_mm"), 3);
  const Json& axes = json.at("axes");
  if (!axes.is_array() || axes.size() != 3) throw Unreadable("a station without three axes");
  for (int i = 0; i < 3; ++i) station.directions_in_machine.col(i) = numbers(axes.at(static_cast<std::size_t>(i)), 3);
  for (const Json& one : json.at("directions")) {
    DirectionKnowledge& direction = station.directions.emplace_back();
    direction.name = one.at("name");
    direction.angle = one.at("unit") == "rad";
    direction.sigma = one.at("sigma_mm_or_rad");
    const Json& share = one.at("share");
    direction.share = {share.at("markers"), share.at("reference"), share.at("axis"), share.at("surface"),
                       share.at("calibration")};
  }
  station.markers = json.at("markers");
  station.points = json.at("points");
  if (const Json& off = json.at("off_axis"); !off.is_null()) {
    station.off_axis = numbers(off, 6);
    station.off_axis_w = json.at("off_axis_w");
  }
  return station;
}

Stitching stitching_of(const Json& json) {
  detail::check_verb(json, "stitch");
  Stitching result;
  result.frame = json.at("frame");
  result.segment = segment_of(json.at("segment"));
  for (const Json& station : json.at("stations")) result.stations.push_back(station_of(station));
  const auto index = [&](const Json& name) {
    const auto found =
        std::find_if(result.stations.begin(), result.stations.end(), [&](const auto& s) { return name == s.name; });
    if (found == result.stations.end()) throw Unreadable(fmt::format("a station called {}", name.dump()));
    return static_cast<int>(found - result.stations.begin());
  };
  for (const Json& one : json.at("overlap")) {
    StitchedOverlap& overlap = result.overlaps.emplace_back();
    overlap.a = index(one.at("a"));
    overlap.b = index(one.at("b"));
    overlap.matches = one.at("matches");
    overlap.mean_mm = one.at("mean_mm");
    overlap.sigma_mm = one.at("sigma_mm");
    overlap.rms_mm = one.at("rms_mm");
    overlap.normalised = one.at("normalised");
    overlap.not_seen = one.at("not_seen").get<std::vector<std::string>>();
  }
  for (const Json& one : json.at("markers")) {
    StitchedMarker& marker = result.markers.emplace_back();
    marker.id = one.at("id");
    marker.xyz_mm = numbers(one.at("xyz_mm"), 3);
    marker.cov_mm2 = symmetric(one.at("cov_mm2"), 3);
    for (const Json& station : one.at("stations")) marker.stations.push_back(index(station));
    marker.max_w = one.at("max_w");
    if (const Json& residual = one.at("reference_residual_mm"); !residual.is_null()) {
      marker.in_reference = true;
      marker.reference_residual_mm = numbers(residual, 3);
    }
  }
  if (const Json& part = json.at("machine_from_part"); !part.is_null()) {
    result.machine_from_part = detail::pose_of(part);
    result.machine_from_part_cov = symmetric(json.at("machine_from_part_cov"), 6);
  }
  if (!json.at("rig").is_null()) result.head = detail::head_of(json);
  result.calibration_shift = json.at("calibration_shift");
  result.surface_factor = json.at("surface_factor");
  result.independent_share = json.at("independent_share");
  result.marker_ratio = json.at("marker_ratio");
  result.reference_ratio = json.at("reference_ratio");
  result.observations = json.at("observations");
  result.unknowns = json.at("unknowns");
  result.redundancy = json.at("redundancy");
  return result;
}

}  // namespace

Result<Stitching> read_stitching(const std::filesystem::path& folder) {
  auto result = detail::read_result(folder, stitching_of);
  if (!result) return result;
  auto joint = read_covariance(folder);
  if (!joint) return fail(std::move(joint));
  const Eigen::Index poses = 6 * static_cast<Eigen::Index>(result->stations.size());
  const Eigen::Index head = result->head ? result->head->parameter_count() : 0;
  if (joint->matrix.rows() != poses + head) {
    return detail::bad_result(folder / "result.json",
                              fmt::format("its covariance has {} rows, {} belong to it", joint->matrix.rows(), poses + head));
  }
  result->covariance = std::move(joint->matrix);
  result->labels = std::move(joint->labels);
  if (result->head) result->head->cov = result->covariance.bottomRightCorner(head, head);
  return result;
}

}  // namespace crosstie::base
