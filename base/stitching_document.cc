// stitching -> JSON (docs/formats.md)

#include "base/stitching_document.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/detail/result_reading.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::list_json;
using detail::matrix_json;
using detail::upper_triangle_json;

/// Not a number: nothing joins them.
Json or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json segment_json(const Segment& segment) {
  return {{"kind", std::string(segment_name(segment.kind))},
          {"point_mm", list_json(segment.point_mm)},
          {"direction", list_json(segment.direction)},
          {"radius_mm", segment.radius_mm},
          {"half_angle_rad", segment.half_angle_rad},
          {"rms_mm", segment.rms_mm},
          {"given", segment.given}};
}

Json station_json(const StitchedStation& station) {
  Json json = {{"name", station.name},
               {"axis_mm", station.axis_mm ? Json(*station.axis_mm) : Json(nullptr)},
               {"machine_from_rig", matrix_json(station.machine_from_rig)},
               {"cov", upper_triangle_json(station.cov)},
               {"centre_mm", list_json(station.centre_mm)},
               {"markers", station.markers},
               {"points", station.points}};
  for (int i = 0; i < 3; ++i) json["axes"].push_back(list_json(Eigen::Vector3d(station.directions_in_machine.col(i))));
  json["directions"] = Json::array();
  for (const DirectionKnowledge& direction : station.directions) {
    const SourceShares& share = direction.share;
    json["directions"].push_back({{"name", direction.name},
                                  {"unit", direction.angle ? "rad" : "mm"},
                                  {"sigma_mm_or_rad", direction.sigma},
                                  {"share",
                                   {{"markers", share.markers},
                                    {"reference", share.reference},
                                    {"axis", share.axis},
                                    {"surface", share.surface},
                                    {"calibration", share.calibration}}}});
  }
  json["off_axis"] = station.off_axis ? list_json(*station.off_axis) : Json(nullptr);
  json["off_axis_w"] = station.off_axis ? Json(station.off_axis_w) : Json(nullptr);
  return json;
}

}  // namespace

Json stitching_json(const Stitching& stitching) {
  const auto name = [&](int station) { return stitching.stations.at(static_cast<std::size_t>(station)).name; };
  Json json;
  json["segment"] = segment_json(stitching.segment);
  for (const char* key : {"stations", "overlap", "markers", "rejected", "drift", "icp_iterations"}) json[key] = Json::array();
  for (const StitchedStation& station : stitching.stations) json["stations"].push_back(station_json(station));
  for (const StitchedOverlap& overlap : stitching.overlaps) {
    Json cells = Json::array();
    for (const OverlapCell& cell : overlap.cells) {
      cells.push_back(
          {{"centre_mm", list_json(cell.centre_mm)}, {"difference_mm", cell.difference_mm}, {"sigma_mm", cell.sigma_mm}});
    }
    json["overlap"].push_back({{"a", name(overlap.a)},
                               {"b", name(overlap.b)},
                               {"mean_mm", overlap.mean_mm},
                               {"sigma_mm", overlap.sigma_mm},
                               {"normalised", overlap.normalised},
                               {"rms_mm", overlap.rms_mm},
                               {"matches", overlap.matches},
                               {"not_seen", overlap.not_seen},
                               {"cells", std::move(cells)}});
  }
  for (const StitchedMarker& marker : stitching.markers) {
    Json stations = Json::array();
    for (const int station : marker.stations) stations.push_back(name(station));
    json["markers"].push_back(
        {{"id", marker.id},
         {"xyz_mm", list_json(marker.xyz_mm)},
         {"cov_mm2", upper_triangle_json(marker.cov_mm2)},
         {"stations", std::move(stations)},
         {"max_w", marker.max_w},
         {"reference_residual_mm", marker.in_reference ? list_json(marker.reference_residual_mm) : Json(nullptr)}});
  }
  for (const RejectedSighting& rejected : stitching.rejected) {
    json["rejected"].push_back({{"station", rejected.station < 0 ? Json(nullptr) : Json(name(rejected.station))},
                                {"id", rejected.id},
                                {"reason", rejected.reason},
                                {"distance_mm", rejected.distance_mm},
                                {"w", rejected.w}});
  }
  for (const StitchDrift& drift : stitching.drift) {
    Json free = Json::array();
    for (int i = 0; i < 3; ++i) free.push_back(or_null(drift.free_sigma_mm(i)));
    json["drift"].push_back({{"from", name(drift.from)},
                             {"to", name(drift.to)},
                             {"distance_mm", drift.distance_mm},
                             {"sigma_mm", list_json(drift.sigma_mm)},
                             {"free_sigma_mm", std::move(free)}});
  }
  for (const StitchIteration& iteration : stitching.iterations) {
    json["icp_iterations"].push_back(
        {{"matches", iteration.matches}, {"moved_mm", iteration.moved_mm}, {"rms_mm", iteration.rms_mm}});
  }
  json["machine_from_part"] = stitching.machine_from_part ? matrix_json(*stitching.machine_from_part) : Json(nullptr);
  json["machine_from_part_cov"] =
      stitching.machine_from_part ? upper_triangle_json(stitching.machine_from_part_cov) : Json(nullptr);
  json["cameras"] = nullptr;
  json["rig"] = nullptr;
  if (stitching.head) {
    const Head& head = *stitching.head;
    json["cameras"] = {detail::lens_json(head.left_name, head.left, true),
                       detail::lens_json(head.right_name, head.right, true)};
    json["rig"] = {{"left", head.left_name},
                   {"right", head.right_name},
                   {"right_from_left", matrix_json(head.right_from_left)},
                   {"temperature_c", head.temperature_c ? Json(*head.temperature_c) : Json(nullptr)}};
  }
  json["calibration_shift"] = stitching.calibration_shift;
  json["surface_factor"] = stitching.surface_factor;
  json["independent_share"] = stitching.independent_share;
  json["marker_ratio"] = stitching.marker_ratio;
  json["reference_ratio"] = stitching.reference_ratio;
  json["observations"] = stitching.observations;
  json["unknowns"] = stitching.unknowns;
  json["redundancy"] = stitching.redundancy;
  return json;
}

}  // namespace crosstie::base
