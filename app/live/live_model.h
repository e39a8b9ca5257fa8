#pragma once

#include <array>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/live/guidance.h"
#include "app/live/job_facts.h"
#include "app/live/job_scene.h"
#include "app/live/live_status.h"
#include "app/live/shots.h"
#include "base/machine.h"
#include "base/result.h"
#include "base/stitching.h"
#include "devices/axis_reader.h"

namespace crosstie::app {

/// What was taken last.
struct LastShot {
  LiveStage stage = LiveStage::kCalibrate;
  std::string what = {};
  std::string station = {};
  PairOfFiles places = {};
};

/// What is going on, as workers and devices tell it.
struct LiveActivity {
  std::string taking = {};  ///< empty: nothing
  std::string computing = {};
  std::optional<WorkStatus> work = {};
  base::Result<devices::AxisReading> axis = devices::AxisReading{};
  AxisStatus axis_status = {};
  std::string cameras_trouble = {};
  bool has_projector = false;
};

/// The head as far as it is known.
struct KnownHead {
  std::optional<base::Head> head = {};  ///< of the commissioning, else of the calibration
  std::optional<base::Commissioning> commissioning = {};
};

/// All that a session knows of its job: what job.toml asks for, what lies in the folder, what the results say, and what the operator
/// chose. Safe to call from any thread.
class LiveModel {
 public:
  /// Errors: those of the job.
  static base::Result<std::unique_ptr<LiveModel>> read(const std::filesystem::path& job);

  /// Reads job, images and results again, with some points of each cloud that is new; clouds that cannot be read show none. An Error
  /// leaves everything as it was.
  base::Result<> reload();

  [[nodiscard]] Job job() const;
  [[nodiscard]] std::filesystem::path results() const;
  [[nodiscard]] LiveStage stage() const;
  void choose(LiveStage stage);
  /// kUsage where the job has no such station.
  base::Result<> select(const std::string& station);
  /// What undo and repeat are about: of kCalibrate, where none was taken in this session, the last pair in the folder by its name.
  [[nodiscard]] std::optional<LastShot> last() const;
  /// What was taken last of its stage; nothing: of the stage that is on.
  void remember(std::optional<LastShot> shot);
  void log(const std::string& level, std::string text);
  /// The next pose that the board should take; empty: any.
  void set_wanted_pose(std::string pose);

  [[nodiscard]] std::shared_ptr<const KnownHead> known_head() const;

  [[nodiscard]] Guidance guidance(const LiveActivity& activity) const;
  /// Everything but the cameras, their markers and the board.
  [[nodiscard]] LiveStatus status(const LiveActivity& activity) const;
  /// Grows whenever scene() would say something else, markers aside.
  [[nodiscard]] std::uint64_t scene_version() const;
  [[nodiscard]] std::string scene(const std::vector<MarkerStatus>& markers, const std::string& frame,
                                  const std::optional<base::Pose>& machine_from_head, std::uint64_t version) const;

 private:
  LiveModel() = default;
  [[nodiscard]] Situation situation(const LiveActivity& activity) const;
  [[nodiscard]] std::map<std::string, ScenePatch> patches() const;
  [[nodiscard]] std::vector<StageStatus> stages() const;
  [[nodiscard]] std::vector<StationStatus> station_statuses(const std::optional<StationShots>& current) const;
  [[nodiscard]] std::optional<base::Pose> machine_from_rig(const ScenePatch& patch) const;

  std::filesystem::path file_;
  std::mutex reloading_;      ///< before mutex_
  mutable std::mutex mutex_;  ///< of all below
  Job job_;
  base::Result<BoardShots> board_ = BoardShots{};
  base::Result<std::vector<StationShots>> stations_ = std::vector<StationShots>{};
  JobFacts facts_;
  std::shared_ptr<const KnownHead> known_head_ = std::make_shared<KnownHead>();
  std::optional<base::Stitching> stitching_;
  std::vector<RimPiece> rim_;
  std::map<std::string, ScenePatch> patches_;
  std::uint64_t scene_version_ = 0;
  LiveStage stage_ = LiveStage::kCalibrate;
  std::string selected_;
  std::map<LiveStage, LastShot> last_;  ///< of this session
  std::string wanted_pose_;
  std::deque<LogLine> log_;
};

}  // namespace crosstie::app
