#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/live/live_status.h"
#include "app/live/shots.h"
#include "base/result.h"
#include "devices/axis_reader.h"

namespace crosstie::app {

/// What is known at one moment of a job that is being worked on at the machine.
struct Situation {
  LiveStage stage = LiveStage::kCalibrate;
  base::Result<BoardShots> board = BoardShots{};
  base::Result<std::vector<StationShots>> stations = std::vector<StationShots>{};
  std::string selected = {};              ///< station that the operator chose; empty: the first that lacks something
  std::vector<std::string> scanned = {};  ///< stations whose cloud is there
  bool calibrated = false;                ///< results are there
  bool commissioned = false;
  bool measured = false;             ///< the hole's edge and the torch's path are there
  bool needs_commissioning = false;  ///< the job has a cross
  std::string cameras_trouble = {};  ///< empty: they run
  base::Result<devices::AxisReading> axis = devices::AxisReading{};
  double axis_sigma_mm = 0.0;  ///< of a reading, as the job tells it
  bool has_projector = false;
  std::string taking = {};        ///< what is being taken now; empty: nothing
  std::string computing = {};     ///< what is being computed; empty: nothing
  std::string last = {};          ///< what was taken last in this stage; empty: nothing
  std::string last_station = {};  ///< its station
  std::string wanted_pose = {};   ///< of the board, in words; empty: any
};

/// Pairs of the board that a calibration should have (docs/commissioning.md).
inline constexpr int kWantedPoses = 25;
/// Below it a calibration is refused by itself.
inline constexpr int kLeastPoses = 3;
/// How far from its planned place a station may be taken, in mm: farther off somebody has driven to another one.
inline constexpr double kStationReach_mm = 20.0;

/// How far two readings at one stop may differ, in mm.
[[nodiscard]] double same_stop_mm(double axis_sigma_mm);

/// What the operator should do, may do, and why not.
struct Guidance {
  std::string instruction = {};
  std::vector<Permission> permissions = {};  ///< of next, repeat, undo, finish, cancel, check
  std::optional<StationShots> station = {};  ///< the one that is next; nothing in kCalibrate or where none is
  int have = 0;                              ///< of the stage's shots
  int want = 0;

  [[nodiscard]] const std::string& why_not(const std::string& command) const;
};

[[nodiscard]] Guidance guide(const Situation& now);

}  // namespace crosstie::app
