#include "app/live/live_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/core.h>

#include "app/head_files.h"
#include "app/job_scan.h"
#include "base/commissioning_reader.h"
#include "base/stitching_reader.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

constexpr std::size_t kLogLines = 100;
constexpr std::array<LiveStage, 3> kStages = {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan};

std::string time_of_day() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%H:%M:%S}", fmt::localtime(now));
}

std::string utc_now() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now));
}

std::optional<double> finite(double value) { return std::isfinite(value) ? std::optional(value) : std::nullopt; }

}  // namespace

Result<std::unique_ptr<LiveModel>> LiveModel::read(const fs::path& job) {
  auto first = read_job(job);
  if (!first) return base::fail(std::move(first));
  std::unique_ptr<LiveModel> model(new LiveModel());
  model->file_ = first->file;
  if (auto loaded = model->reload(); !loaded) return base::fail(std::move(loaded));
  // Go on where the work stopped.
  for (const LiveStage stage : kStages) {
    model->stage_ = stage;
    const bool wanted = stage == LiveStage::kCalibrate    ? model->job_.board.has_value()
                        : stage == LiveStage::kCommission ? model->job_.cross.has_value()
                                                          : true;
    if (wanted && !model->facts_.done(stage)) break;
  }
  return model;
}

Result<> LiveModel::reload() {
  const std::lock_guard one_at_a_time(reloading_);  // what was read first is never put over what was read later
  auto job = read_job(file_);
  if (!job) return base::fail(std::move(job));
  const fs::path results = job->folder / "results";
  auto board = board_shots(*job);
  auto stations = station_shots(*job);
  JobFacts facts = read_job_facts(*job, results);
  auto known = std::make_shared<KnownHead>();
  if (auto read = base::read_commissioning(results / "commission")) known->commissioning = *std::move(read);
  if (known->commissioning) {
    known->head = known->commissioning->head;
  } else if (const auto folder = scan_head_folder(*job, results)) {
    if (auto read = read_head(folder->string(), 0, 0)) known->head = std::move(read->head);
  }
  std::optional<base::Stitching> stitching;
  if (auto read = base::read_stitching(results / "stitch")) stitching = *std::move(read);
  std::vector<RimPiece> rim = read_rim(results / "edge");
  std::map<std::string, ScenePatch> patches = this->patches();
  std::erase_if(patches, [&](const auto& one) { return !facts.scanned.contains(one.first); });
  for (const JobStation& station : job->stations) {
    if (!facts.scanned.contains(station.name) || patches.contains(station.name)) continue;
    if (auto patch = read_patch(results / "scan" / station.name, station.name, station.axis_mm))
      patches.emplace(station.name, *std::move(patch));
  }

  const std::lock_guard lock(mutex_);
  job_ = *std::move(job);
  board_ = std::move(board);
  stations_ = std::move(stations);
  facts_ = std::move(facts);
  known_head_ = std::move(known);
  stitching_ = std::move(stitching);
  rim_ = std::move(rim);
  patches_ = std::move(patches);
  ++scene_version_;
  return {};
}

std::map<std::string, ScenePatch> LiveModel::patches() const {
  const std::lock_guard lock(mutex_);
  return patches_;
}

Job LiveModel::job() const {
  const std::lock_guard lock(mutex_);
  return job_;
}

fs::path LiveModel::results() const { return file_.parent_path() / "results"; }

LiveStage LiveModel::stage() const {
  const std::lock_guard lock(mutex_);
  return stage_;
}

void LiveModel::choose(LiveStage stage) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  selected_.clear();
}

Result<> LiveModel::select(const std::string& station) {
  const std::lock_guard lock(mutex_);
  const bool known =
      std::any_of(job_.stations.begin(), job_.stations.end(), [&](const JobStation& one) { return one.name == station; });
  if (!known) return base::fail(ErrorCode::kUsage, fmt::format("the job has no station '{}'", station));
  if (stations_ && (stage_ == LiveStage::kCommission || stage_ == LiveStage::kScan)) {
    const auto found =
        std::find_if(stations_->begin(), stations_->end(), [&](const StationShots& one) { return one.name == station; });
    const bool cross = stage_ == LiveStage::kCommission;
    if (found != stations_->end() && !(cross ? found->wants_cross : found->wants_scan)) {
      return base::fail(ErrorCode::kUsage,
                        fmt::format("the job has no {} at station '{}'", cross ? "photograph of the cross" : "scan", station));
    }
  }
  selected_ = station;
  return {};
}

std::optional<LastShot> LiveModel::last() const {
  const std::lock_guard lock(mutex_);
  const auto found = last_.find(stage_);
  if (stage_ != LiveStage::kCalibrate) return found == last_.end() ? std::nullopt : std::optional(found->second);
  if (!board_ || board_->taken.empty()) return std::nullopt;
  const std::vector<PairOfFiles>& taken = board_->taken;
  if (found != last_.end() && std::find(taken.begin(), taken.end(), found->second.places) != taken.end()) return found->second;
  const PairOfFiles& pair = taken.back();
  return LastShot{LiveStage::kCalibrate, fmt::format("board {}", pair[0].stem().string()), {}, pair};
}

void LiveModel::remember(std::optional<LastShot> shot) {
  const std::lock_guard lock(mutex_);
  if (!shot) {
    last_.erase(stage_);
    return;
  }
  selected_.clear();
  last_.insert_or_assign(shot->stage, *std::move(shot));
}

void LiveModel::log(const std::string& level, std::string text) {
  const std::lock_guard lock(mutex_);
  log_.push_back({time_of_day(), level, std::move(text)});
  if (log_.size() > kLogLines) log_.pop_front();
}

void LiveModel::set_wanted_pose(std::string pose) {
  const std::lock_guard lock(mutex_);
  wanted_pose_ = std::move(pose);
}

std::shared_ptr<const KnownHead> LiveModel::known_head() const {
  const std::lock_guard lock(mutex_);
  return known_head_;
}

Situation LiveModel::situation(const LiveActivity& activity) const {
  const std::optional<LastShot> last = this->last();
  const std::lock_guard lock(mutex_);
  Situation now{.stage = stage_, .board = board_, .stations = stations_, .selected = selected_, .scanned = {}};
  for (const auto& [station, epipolar] : facts_.scanned) now.scanned.push_back(station);
  now.calibrated = facts_.done(LiveStage::kCalibrate) || known_head_->head.has_value();
  now.commissioned = facts_.done(LiveStage::kCommission);
  now.measured = facts_.done(LiveStage::kScan);
  now.needs_commissioning = job_.cross.has_value();
  now.cameras_trouble = activity.cameras_trouble;
  now.axis = activity.axis;
  if (job_.machine) now.axis_sigma_mm = job_.machine->axis_sigma_mm.value_or(0.0);
  now.has_projector = activity.has_projector;
  now.taking = activity.taking;
  now.computing = activity.computing;
  if (last) {
    now.last = last->what;
    now.last_station = last->station;
  }
  now.wanted_pose = wanted_pose_;
  return now;
}

Guidance LiveModel::guidance(const LiveActivity& activity) const { return guide(situation(activity)); }

/// Call with the mutex held.
std::vector<StageStatus> LiveModel::stages() const {
  std::vector<StageStatus> stages;
  for (const LiveStage stage : kStages) {
    Situation now{.stage = stage, .board = board_, .stations = stations_, .selected = {}, .scanned = {}};
    const Guidance guidance = guide(now);
    StageStatus status{.stage = stage, .have = guidance.have, .want = guidance.want, .summary = {}, .report = {}};
    if (const auto found = facts_.results.find(stage); found != facts_.results.end()) {
      status.state = "done";
      status.summary = found->second.summary;
      status.report = found->second.report;
    } else if (guidance.have > 0) {
      status.state = guidance.have < guidance.want ? "begun" : "ready";
    }
    stages.push_back(std::move(status));
  }
  return stages;
}

/// Call with the mutex held.
std::vector<StationStatus> LiveModel::station_statuses(const std::optional<StationShots>& current) const {
  std::vector<StationStatus> statuses;
  if (!stations_) return statuses;
  for (const StationShots& shots : *stations_) {
    StationStatus status{.name = shots.name, .axis_mm = shots.axis_mm, .cross = "none", .scan = "none"};
    if (shots.cross_taken || shots.scan_taken) status.measured_mm = shots.axis_mm;
    if (shots.wants_cross) status.cross = shots.cross_taken ? "taken" : "missing";
    if (shots.wants_scan) status.scan = shots.scan_taken ? "taken" : "missing";
    if (const auto found = facts_.scanned.find(shots.name); shots.scan_taken && found != facts_.scanned.end()) {
      status.scan = "done";
      status.epipolar_px = finite(found->second.px);
      status.epipolar_sigma_px = finite(found->second.sigma_px);
    }
    status.current = current && current->name == shots.name;
    statuses.push_back(std::move(status));
  }
  return statuses;
}

LiveStatus LiveModel::status(const LiveActivity& activity) const {
  const Guidance guidance = this->guidance(activity);
  const std::lock_guard lock(mutex_);
  LiveStatus status;
  status.time = utc_now();
  status.job_name = job_.name;
  status.job_folder = fs::absolute(job_.folder).lexically_normal().filename().string();
  status.stage = stage_;
  status.stages = stages();
  status.instruction = guidance.instruction;
  status.permissions = guidance.permissions;
  status.axis = activity.axis_status;
  status.stations = station_statuses(guidance.station);
  status.work = activity.work;
  status.health = facts_.health;
  status.gaps = facts_.gaps;
  if (const auto found = facts_.results.find(stage_); found != facts_.results.end()) status.verdicts = found->second.verdicts;
  status.log.assign(log_.begin(), log_.end());
  return status;
}

std::uint64_t LiveModel::scene_version() const {
  const std::lock_guard lock(mutex_);
  return scene_version_;
}

/// As stitched, else on the commissioned axis. Call with the mutex held.
std::optional<base::Pose> LiveModel::machine_from_rig(const ScenePatch& patch) const {
  if (stitching_) {
    for (const base::StitchedStation& station : stitching_->stations) {
      if (station.name == patch.station) return station.machine_from_rig;
    }
  }
  if (!known_head_->commissioning) return std::nullopt;
  const auto pose = known_head_->commissioning->frame.at(patch.axis_mm);
  return pose ? std::optional(pose->machine_from_rig) : std::nullopt;
}

std::string LiveModel::scene(const std::vector<MarkerStatus>& markers, const std::string& frame,
                             const std::optional<base::Pose>& machine_from_head, std::uint64_t version) const {
  const std::lock_guard lock(mutex_);
  LiveScene scene{.version = version, .frame = frame.empty() ? "machine" : frame, .markers = markers};
  if (scene.frame == "machine") {
    scene.frame_from_head = machine_from_head;
    for (const auto& [station, patch] : patches_) {
      if (const auto pose = machine_from_rig(patch)) scene.patches.push_back({&patch, *pose});
    }
    scene.rim = rim_;
  }
  return scene_json(scene);
}

}  // namespace crosstie::app
