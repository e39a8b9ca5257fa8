#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/verdict.h"

namespace crosstie::app {

/// The jobs that the operator's page guides through, in their order.
enum class LiveStage { kCalibrate, kCommission, kScan };

/// "calibrate", "commission", "scan".
[[nodiscard]] std::string live_stage_name(LiveStage stage);
[[nodiscard]] std::optional<LiveStage> live_stage_from_name(const std::string& name);

struct StageStatus {
  LiveStage stage = LiveStage::kCalibrate;
  std::string state = "empty";  ///< empty, begun, ready (all is taken), done (its result is there)
  int have = 0;
  int want = 0;
  std::string summary = {};  ///< of its result
  std::string report = {};   ///< page in the job's folder; empty: none yet
};

/// What the page may do now: the command, and why not where that is not empty.
struct Permission {
  std::string command = {};
  std::string why_not = {};
};

struct CameraStatus {
  std::string side = {};
  std::string name = {};
  bool running = false;
  std::string trouble = {};
  std::uint64_t frames = 0, dropped = 0, lost = 0, swapped = 0, incomplete = 0;
  double rate_hz = 0.0;
  std::optional<double> latency_ms = {};
  double exposure_s = 0.0;
  double gain = 0.0;
  std::optional<double> temperature_c = {};
  bool warming = false;
  int width_px = 0;
  int height_px = 0;
  std::array<float, 64> histogram = {};  ///< shares of the pixels
  double saturated = 0.0;
  double dark = 0.0;
  std::optional<double> focus = {};
  std::optional<double> blur_px = {};
  int coded = 0, uncoded = 0, doubtful = 0;
};

struct MarkerStatus {
  int id = 0;
  bool doubtful = false;
  bool left = false;
  bool right = false;
  std::optional<Eigen::Vector3d> xyz_mm = {};
  std::optional<Eigen::Vector3d> sigma_mm = {};
  std::optional<double> w = {};  ///< residual over sigma
};

struct NeededMarkers {
  int want = 0;
  int seen = 0;
  std::vector<int> missing = {};
};

struct AxisStatus {
  std::string source = {};
  bool typed = false;
  std::optional<double> position_mm = {};
  std::optional<double> age_s = {};
  bool fresh = false;
  std::string trouble = {};
};

struct BoardStatus {
  int columns = 0;
  int rows = 0;
  std::array<std::vector<int>, 2> counts = {};  ///< of corners in each cell, left and right, row by row
  int poses = 0;
  int tilted_left = 0, tilted_right = 0, tilted_up = 0, tilted_down = 0, rolled = 0;
  std::string wanted = {};                      ///< the next pose in words; empty: enough
  std::optional<std::array<int, 2>> cell = {};  ///< column and row that it should lie in,
  std::string cell_side = {};                   ///< in the image of this camera
};

struct StationStatus {
  std::string name = {};
  double axis_mm = 0.0;
  std::optional<double> measured_mm = {};
  std::string cross = {};  ///< none, missing, taken
  std::string scan = {};   ///< none, missing, taken, done
  std::optional<double> epipolar_px = {};
  std::optional<double> epipolar_sigma_px = {};
  bool current = false;
};

struct WorkStatus {
  std::string what = {};
  std::string stage = {};
  std::size_t done = 0;
  std::size_t total = 0;
  double seconds = 0.0;
};

struct HealthStatus {
  std::string level = "NONE";  ///< NONE, OK, WARNING, FAIL
  std::string text = {};
};

struct GapStatus {
  int count = 0;
  double length_mm = 0.0;
  double coverage = 0.0;  ///< share of the rim that was seen
};

struct LogLine {
  std::string time = {};   ///< of the day, HH:MM:SS
  std::string level = {};  ///< info, warning, error
  std::string text = {};
};

/// All that the page shows at one moment.
struct LiveStatus {
  std::uint64_t sequence = 0;
  std::string time = {};  ///< UTC
  std::string job_name = {};
  std::string job_folder = {};
  LiveStage stage = LiveStage::kCalibrate;
  std::vector<StageStatus> stages = {};
  std::string instruction = {};
  std::vector<Permission> permissions = {};
  std::array<CameraStatus, 2> cameras = {};
  std::uint64_t pairs = 0, unmatched = 0, contradicted = 0;
  std::vector<MarkerStatus> markers = {};
  std::string frame = {};  ///< of the markers: machine, rig; empty: none
  std::optional<NeededMarkers> needed = {};
  AxisStatus axis = {};
  std::optional<BoardStatus> board = {};
  std::vector<StationStatus> stations = {};
  std::optional<WorkStatus> work = {};
  HealthStatus health = {};
  std::optional<GapStatus> gaps = {};
  std::vector<base::Verdict> verdicts = {};
  std::uint64_t scene_version = 0;
  std::vector<LogLine> log = {};
};

/// The status as the page reads it (docs/live.md), one line of JSON. Text that is not UTF-8 is shown with replacement characters;
/// numbers that are not finite become null.
std::string status_json(const LiveStatus& status);

}  // namespace crosstie::app
