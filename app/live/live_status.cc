#include "app/live/live_status.h"
#include "report/verdict_words.h"

#include <nlohmann/json.hpp>

namespace crosstie::app {
namespace {

using nlohmann::ordered_json;

template <typename T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json triple(const std::optional<Eigen::Vector3d>& value) {
  if (!value) return nullptr;
  return {value->x(), value->y(), value->z()};
}

std::string title_of(LiveStage stage) {
  switch (stage) {
    case LiveStage::kCalibrate:
      return "Calibrate the cameras";
    case LiveStage::kCommission:
      return "Commission the machine";
    case LiveStage::kScan:
      break;
  }
  return "Scan the hole";
}

ordered_json stage_json(const StageStatus& stage) {
  return {{"name", live_stage_name(stage.stage)},
          {"title", title_of(stage.stage)},
          {"state", stage.state},
          {"have", stage.have},
          {"want", stage.want},
          {"summary", stage.summary},
          {"report", stage.report.empty() ? ordered_json(nullptr) : ordered_json(stage.report)}};
}

ordered_json camera_json(const CameraStatus& camera) {
  return {{"side", camera.side},
          {"name", camera.name},
          {"running", camera.running},
          {"trouble", camera.trouble},
          {"frames", camera.frames},
          {"dropped", camera.dropped},
          {"lost", camera.lost},
          {"swapped", camera.swapped},
          {"incomplete", camera.incomplete},
          {"rate_hz", camera.rate_hz},
          {"latency_ms", or_null(camera.latency_ms)},
          {"exposure_s", camera.exposure_s},
          {"gain", camera.gain},
          {"temperature_c", or_null(camera.temperature_c)},
          {"warming", camera.warming},
          {"width_px", camera.width_px},
          {"height_px", camera.height_px},
          {"histogram", camera.histogram},
          {"saturated", camera.saturated},
          {"dark", camera.dark},
          {"focus", or_null(camera.focus)},
          {"blur_px", or_null(camera.blur_px)},
          {"coded", camera.coded},
          {"uncoded", camera.uncoded},
          {"doubtful", camera.doubtful}};
}

ordered_json marker_json(const MarkerStatus& marker) {
  return {{"id", marker.id},
          {"state", marker.doubtful ? "doubtful" : "coded"},
          {"left", marker.left},
          {"right", marker.right},
          {"xyz_mm", triple(marker.xyz_mm)},
          {"sigma_mm", triple(marker.sigma_mm)},
          {"w", or_null(marker.w)}};
}

ordered_json axis_json(const AxisStatus& axis) {
  return {{"source", axis.source},        {"typed", axis.typed}, {"position_mm", or_null(axis.position_mm)},
          {"age_s", or_null(axis.age_s)}, {"fresh", axis.fresh}, {"trouble", axis.trouble}};
}

ordered_json board_json(const BoardStatus& board) {
  return {{"columns", board.columns},
          {"rows", board.rows},
          {"left", board.counts[0]},
          {"right", board.counts[1]},
          {"poses", board.poses},
          {"tilts",
           {{"left", board.tilted_left},
            {"right", board.tilted_right},
            {"up", board.tilted_up},
            {"down", board.tilted_down},
            {"rolled", board.rolled}}},
          {"wanted", board.wanted},
          {"cell", or_null(board.cell)},
          {"cell_side", board.cell_side}};
}

ordered_json station_json(const StationStatus& station) {
  return {{"name", station.name},      {"axis_mm", station.axis_mm}, {"measured_mm", or_null(station.measured_mm)},
          {"cross", station.cross},    {"scan", station.scan},       {"epipolar_px", or_null(station.epipolar_px)},
          {"current", station.current}};
}

ordered_json verdict_json(const base::Verdict& verdict) {
  return {{"name", report::verdict_words(verdict.name)},
          {"value", verdict.value},
          {"limit", verdict.limit},
          {"unit", verdict.unit},
          {"source", verdict.source},
          {"level", std::string(base::verdict_level_name(verdict.level))}};
}

template <typename List, typename ToJson>
ordered_json list_json(const List& list, ToJson to_json) {
  ordered_json json = ordered_json::array();
  for (const auto& one : list) json.push_back(to_json(one));
  return json;
}

ordered_json drift_json(const std::vector<StationStatus>& stations) {
  ordered_json drift = ordered_json::array();
  for (const StationStatus& station : stations) {
    if (!station.epipolar_px) continue;
    drift.push_back(
        {{"station", station.name}, {"epipolar_px", *station.epipolar_px}, {"sigma_px", or_null(station.epipolar_sigma_px)}});
  }
  return drift;
}

}  // namespace

std::string live_stage_name(LiveStage stage) {
  switch (stage) {
    case LiveStage::kCalibrate:
      return "calibrate";
    case LiveStage::kCommission:
      return "commission";
    case LiveStage::kScan:
      break;
  }
  return "scan";
}

std::optional<LiveStage> live_stage_from_name(const std::string& name) {
  for (const LiveStage stage : {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan}) {
    if (live_stage_name(stage) == name) return stage;
  }
  return std::nullopt;
}

std::string status_json(const LiveStatus& status) {
  ordered_json can = ordered_json::object();
  ordered_json why_not = ordered_json::object();
  for (const Permission& one : status.permissions) {
    can[one.command] = one.why_not.empty();
    why_not[one.command] = one.why_not;
  }
  ordered_json json = {
      {"format", "crosstie-live/1"},
      {"sequence", status.sequence},
      {"time", status.time},
      {"job", {{"name", status.job_name}, {"folder", status.job_folder}}},
      {"stage", live_stage_name(status.stage)},
      {"stages", list_json(status.stages, stage_json)},
      {"instruction", status.instruction},
      {"can", can},
      {"why_not", why_not},
      {"cameras", list_json(status.cameras, camera_json)},
      {"pairs", {{"count", status.pairs}, {"unmatched", status.unmatched}, {"contradicted", status.contradicted}}},
      {"markers", list_json(status.markers, marker_json)},
      {"frame", status.frame.empty() ? ordered_json(nullptr) : ordered_json(status.frame)}};
  json["needed"] = nullptr;
  if (status.needed)
    json["needed"] = {{"want", status.needed->want}, {"seen", status.needed->seen}, {"missing", status.needed->missing}};
  json["axis"] = axis_json(status.axis);
  json["board"] = status.board ? board_json(*status.board) : ordered_json(nullptr);
  json["stations"] = list_json(status.stations, station_json);
  json["work"] = nullptr;
  if (status.work) {
    json["work"] = {{"what", status.work->what},
                    {"stage", status.work->stage},
                    {"done", status.work->done},
                    {"total", status.work->total},
                    {"seconds", status.work->seconds}};
  }
  json["health"] = {{"level", status.health.level}, {"text", status.health.text}};
  json["drift"] = drift_json(status.stations);
  json["gaps"] = nullptr;
  if (status.gaps)
    json["gaps"] = {{"count", status.gaps->count}, {"length_mm", status.gaps->length_mm}, {"coverage", status.gaps->coverage}};
  json["verdicts"] = list_json(status.verdicts, verdict_json);
  json["scene_version"] = status.scene_version;
  json["log"] = list_json(status.log, [](const LogLine& line) {
    return ordered_json{{"time", line.time}, {"level", line.level}, {"text", line.text}};
  });
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace crosstie::app
