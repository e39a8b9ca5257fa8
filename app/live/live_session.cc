#include "app/live/live_session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stop_token>
#include <thread>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/job_index.h"
#include "app/job_scan.h"
#include "app/job_steps.h"
#include "app/live/board_watch.h"
#include "app/live/job_edit.h"
#include "app/live/live_model.h"
#include "app/live/live_watch.h"
#include "app/live/worker.h"
#include "app/steps_commission.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Progress;
using base::Result;
using nlohmann::json;

/// Nothing where the job has no markers.
Result<std::optional<MarkerChoice>> job_markers(const Job& job) {
  if (job.family.empty()) return std::nullopt;
  auto markers = marker_choice(job);
  if (!markers) return base::fail(std::move(markers));
  return *std::move(markers);
}

/// What the stage computes last.
std::string_view last_step(LiveStage stage) { return stage == LiveStage::kCalibrate ? "calibrate" : "commission"; }

Result<std::string> text_of(const json& command, const char* key) {
  if (!command.contains(key) || !command[key].is_string())
    return base::fail(ErrorCode::kBadInput, fmt::format("the command needs the text \"{}\"", key));
  return command[key].get<std::string>();
}

Result<double> number_of(const json& command, const char* key) {
  if (!command.contains(key) || !command[key].is_number())
    return base::fail(ErrorCode::kBadInput, fmt::format("the command needs the number \"{}\"", key));
  return command[key].get<double>();
}

std::string board_name(const PairOfFiles& places) { return fmt::format("board {}", places[0].stem().string()); }

/// A station to be photographed or scanned.
struct StationTask {
  LiveStage stage = LiveStage::kCommission;
  StationShots shots;
  devices::AxisReading reading;

  [[nodiscard]] const PairOfFiles& places() const { return stage == LiveStage::kScan ? shots.scan : shots.cross; }
  /// The other kind of image was taken at this stop already: its reading stays.
  [[nodiscard]] bool read_already() const { return stage == LiveStage::kScan ? shots.cross_taken : shots.scan_taken; }
  [[nodiscard]] std::string what() const {
    return fmt::format("{} {}", stage == LiveStage::kScan ? "scan" : "cross", shots.name);
  }
};

}  // namespace

struct LiveSession::Parts {
  Parts(std::unique_ptr<LiveModel> read, const std::optional<MarkerChoice>& markers, LiveDevices given, live::Feed& page,
        int with_threads)
      : model(std::move(read)),
        devices(std::move(given)),
        feed(page),
        threads(with_threads),
        pairs(*devices.pairs, devices.preview_hz),
        watch(pairs, feed, markers),
        computing([this](const std::string& what, const Result<>& outcome) { tell(what, outcome); }),
        taking([this](const std::string& what, const Result<>& outcome) { tell(what, outcome); }) {}

  void tell(const std::string& what, const Result<>& outcome);
  [[nodiscard]] LiveActivity activity();
  void publish(const std::stop_token& stop);
  void tell_wanted(const LiveStatus& status) const;

  Result<> command(const std::string& text);
  Result<> next(bool again);
  Result<> undo();
  Result<> finish();
  Result<> check();
  Result<> change_exposure(const json& command);

  Result<> take_board(const PairOfFiles& places, const Progress& progress);
  Result<> look_at_boards(const Progress& progress);
  void want_pose();
  Result<fs::path> put_shot_aside(LiveStage stage, const std::string& station, const PairOfFiles& places) const;
  Result<> take_station(const StationTask& task, const Progress& progress);
  Result<> expose(const StationTask& task, const Progress& progress);
  Result<> scan_one(const std::string& station, const Progress& progress);
  Result<> compute(LiveStage stage, const Progress& progress);
  Result<> check_head(double axis_mm, const PairOfFiles& places, const Progress& progress);
  [[nodiscard]] Session session_of(const Progress& progress);

  std::unique_ptr<LiveModel> model;
  LiveDevices devices;
  live::Feed& feed;
  int threads;
  TappedPairs pairs;
  LiveWatch watch;
  BoardWatch board;
  Worker computing;
  Worker taking;        ///< ends first: it gives work to `computing`
  std::mutex commands;  ///< one after the other
  std::jthread publisher;
};

void LiveSession::Parts::tell(const std::string& what, const Result<>& outcome) {
  if (outcome) return;
  const bool cancelled = outcome.error().code == ErrorCode::kCancelled;
  model->log(cancelled ? "info" : "error", fmt::format("{}: {}", what, outcome.error().message));
}

LiveActivity LiveSession::Parts::activity() {
  LiveActivity now;
  const auto takes = taking.status();
  const auto computes = computing.status();
  if (takes) now.taking = takes->what;
  if (computes) now.computing = computes->what;
  now.work = takes ? takes : computes;
  const devices::AxisState state = devices.axis->state();
  const devices::HostTime time = devices::host_now();
  now.axis = devices::fresh_reading(state, time, devices.axis_max_age_s);
  now.axis_status = {.source = state.source,
                     .typed = devices.typed != nullptr,
                     .position_mm = {},
                     .age_s = {},
                     .fresh = now.axis.has_value(),
                     .trouble = state.trouble};
  if (state.latest) {
    now.axis_status.position_mm = state.latest->position_mm;
    now.axis_status.age_s = devices::seconds_between(state.latest->time, time);
  }
  now.cameras_trouble = watch.trouble();
  now.has_projector = devices.projector != nullptr;
  return now;
}

/// Ten times a second: ages, counts and pictures change all the time.
void LiveSession::Parts::publish(const std::stop_token& stop) {
  constexpr auto kPeriod = std::chrono::milliseconds(100);
  std::uint64_t sequence = 0;
  std::uint64_t scene_version = 0;
  std::uint64_t model_version = 0;
  devices::HostTime scene_time;
  while (!stop.stop_requested()) {
    const LiveActivity now = activity();
    watch.set_place(model->known_head(), now.axis);
    LiveStatus status = model->status(now);
    if (devices.wanted) tell_wanted(status);
    watch.describe(status);
    if (status.stage == LiveStage::kCalibrate) status.board = board.status();
    // The scene is large: markers that move are shown once a second.
    const devices::HostTime time = devices::host_now();
    const bool markers_moved = watch.markers_moved() && devices::seconds_between(scene_time, time) > 1.0;
    if (model->scene_version() != model_version || markers_moved) {
      model_version = model->scene_version();
      scene_time = time;
      watch.markers_shown();
      feed.scene.publish(model->scene(status.markers, status.frame, watch.machine_from_rig(), ++scene_version));
    }
    status.scene_version = scene_version;
    status.sequence = ++sequence;
    feed.state.publish(status_json(status));
    std::this_thread::sleep_for(kPeriod);
  }
}

void LiveSession::Parts::tell_wanted(const LiveStatus& status) const {
  const auto stage = std::find_if(status.stages.begin(), status.stages.end(),
                                  [&](const StageStatus& one) { return one.stage == status.stage; });
  const auto station =
      std::find_if(status.stations.begin(), status.stations.end(), [](const StationStatus& one) { return one.current; });
  devices.wanted(status.stage, stage == status.stages.end() ? 0 : stage->have,
                 station == status.stations.end() ? std::string() : station->name);
}

Session LiveSession::Parts::session_of(const Progress& progress) {
  return Session(threads, progress.stop, {progress.report, [this](std::string_view line) {
                                            if (!line.ends_with(".html") && !line.ends_with(".json"))
                                              model->log("info", std::string(line));
                                          }});
}

Result<> LiveSession::Parts::take_board(const PairOfFiles& places, const Progress& progress) {
  if (auto taken = take_pair(pairs, devices.capture, places, progress); !taken) return taken;
  if (auto aside = put_aside(model->job().folder, {places[0], places[1]}); !aside) return base::fail(std::move(aside));
  if (auto placed = place(places); !placed) return placed;
  if (auto loaded = model->reload(); !loaded) return loaded;
  model->remember(LastShot{LiveStage::kCalibrate, board_name(places), {}, places});
  board.forget(places);
  Session session = session_of(progress);
  const auto looked = board.look(model->job(), {places}, session);
  if (!looked && looked.error().code != ErrorCode::kBadInput) return looked;
  const int seen = board.seen_by(places);
  const std::string who = seen == 2 ? "both cameras see" : seen == 1 ? "only one camera sees" : "no camera sees";
  model->log(seen == 2 ? "info" : "warning", fmt::format("{} taken; {} the board{}", board_name(places), who,
                                                         looked ? "" : fmt::format(" ({})", looked.error().message)));
  want_pose();
  return {};
}

Result<> LiveSession::Parts::look_at_boards(const Progress& progress) {
  const Job job = model->job();
  const auto shots = board_shots(job);
  if (!shots) return {};  // the guide says so in the stage that needs it
  Session session = session_of(progress);
  auto looked = board.look(job, shots->taken, session);
  want_pose();
  return looked;
}

void LiveSession::Parts::want_pose() {
  const auto status = board.status();
  model->set_wanted_pose(status ? status->wanted : std::string());
}

Result<> LiveSession::Parts::expose(const StationTask& task, const Progress& progress) {
  if (task.stage != LiveStage::kScan) return take_pair(pairs, devices.capture, task.places(), progress);
  const auto sequence = base::read_pattern_manifest(task.shots.manifest);
  if (!sequence) return tl::unexpected(sequence.error());
  auto images = devices.pattern_images(*sequence);
  if (!images) return base::fail(std::move(images));
  if (auto uploaded = devices.projector->upload(*sequence, *std::move(images)); !uploaded) return uploaded;
  return take_sequence(pairs, *devices.projector, *sequence, devices.capture, task.places(), progress);
}

/// A station's scan takes its result along, which would seem to be that of the next images.
Result<fs::path> LiveSession::Parts::put_shot_aside(LiveStage stage, const std::string& station,
                                                    const PairOfFiles& places) const {
  std::vector<fs::path> paths = {places[0], places[1]};
  if (stage == LiveStage::kScan) paths.push_back(model->results() / "scan" / station);
  return put_aside(model->job().folder, paths);
}

Result<> LiveSession::Parts::take_station(const StationTask& task, const Progress& progress) {
  if (auto exposed = expose(task, progress); !exposed) return exposed;
  const Job job = model->job();
  const devices::AxisState after = devices.axis->state();
  const double sigma_mm = job.machine ? job.machine->axis_sigma_mm.value_or(0.0) : 0.0;
  if (!after.latest)
    return base::fail(ErrorCode::kDevice, "the axis tells no position any more; nothing was kept, take it again");
  const double moved_mm = std::abs(after.latest->position_mm - task.reading.position_mm);
  if (moved_mm > same_stop_mm(sigma_mm)) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("the beam moved by {:.3f} mm meanwhile; nothing was kept, take it again", moved_mm));
  }
  // The reading first: images in their place always belong to the reading in the job.
  const PairOfFiles& places = task.places();
  if (auto aside = put_shot_aside(task.stage, task.shots.name, places); !aside) return base::fail(std::move(aside));
  if (!task.read_already()) {
    if (auto written = write_station_axis(job.file, task.shots.name, task.reading.position_mm); !written) return written;
  }
  if (auto placed = place(places); !placed) return placed;
  if (devices.typed != nullptr) devices.typed->forget();
  if (auto loaded = model->reload(); !loaded) return loaded;
  model->remember(LastShot{task.stage, task.what(), task.shots.name, places});
  model->log("info", fmt::format("{} taken at X = {:.3f} mm", task.what(), task.reading.position_mm));
  if (task.stage == LiveStage::kScan) {
    computing.add(task.what(), [this, station = task.shots.name](const Progress& at) { return scan_one(station, at); });
  }
  return {};
}

Result<> LiveSession::Parts::scan_one(const std::string& station, const Progress& progress) {
  Session session = session_of(progress);
  const Job job = model->job();
  const fs::path results = model->results();
  const auto head = scan_head(job, results, session);
  if (!head) return tl::unexpected(head.error());
  const auto scans = station_scans(job, head->string(), station, results / "scan");
  if (!scans) return tl::unexpected(scans.error());
  const auto tell_scan = [&](const std::string& what, const StepOutcome& step) {
    model->log(step.outcome == Outcome::kOk ? "info" : "warning", fmt::format("{}: {}", what, step.summary));
  };
  const auto done = scan_stations(*scans, tell_scan, session);
  if (!done) return tl::unexpected(done.error());
  if (auto written = write_job_index(job, results); !written) return written;
  return model->reload();
}

Result<> LiveSession::Parts::compute(LiveStage stage, const Progress& progress) {
  Session session = session_of(progress);
  const Job job = model->job();
  const auto steps =
      stage == LiveStage::kScan ? Result<std::vector<const JobStep*>>(steps_of(job)) : steps_until(job, last_step(stage));
  if (!steps) return tl::unexpected(steps.error());
  const auto tell_step = [&](const JobStep& step, const StepOutcome& done) {
    model->log(done.outcome == Outcome::kOk ? "info" : "warning", fmt::format("{}: {}", step.name, done.summary));
  };
  auto done = do_steps(*steps, {job, model->results(), session}, tell_step);
  auto index = write_job_index(job, model->results());  // also of what was done before a step that failed
  auto loaded = model->reload();
  if (!done) return done;
  return index ? loaded : index;
}

Result<> LiveSession::Parts::check_head(double axis_mm, const PairOfFiles& places, const Progress& progress) {
  if (auto taken = take_pair(pairs, devices.capture, places, progress); !taken) return taken;
  const Job job = model->job();
  if (auto aside = put_aside(job.folder, {places[0], places[1]}); !aside) return base::fail(std::move(aside));
  if (auto placed = place(places); !placed) return placed;
  Session session = session_of(progress);
  const HeadCheckTask task{.left = places[0], .right = places[1], .axis_mm = axis_mm, .probed_again = {}, .temperature_c = {}};
  const fs::path results = model->results();
  const auto checked = check_head_step(job, task, results / "commission", results / "check", session);
  if (!checked) return tl::unexpected(checked.error());
  model->log(checked->step.outcome == Outcome::kOk ? "info" : "warning", "check of the head: " + checked->step.summary);
  return model->reload();
}

Result<> LiveSession::Parts::next(bool again) {
  const LiveActivity now = activity();
  const Guidance guidance = model->guidance(now);
  const auto last = model->last();
  if (model->stage() == LiveStage::kCalibrate) {
    PairOfFiles places;
    if (again) {
      places = last->places;
    } else {
      const auto shots = board_shots(model->job());
      if (!shots) return tl::unexpected(shots.error());
      places = shots->next;
    }
    taking.add(board_name(places), [this, places](const Progress& progress) { return take_board(places, progress); });
    return {};
  }
  std::optional<StationShots> station = guidance.station;
  if (again) {
    const auto stations = station_shots(model->job());
    if (!stations) return tl::unexpected(stations.error());
    for (const StationShots& one : *stations) {
      if (one.name == last->station) station = one;
    }
  }
  if (!station) return base::fail(ErrorCode::kUsage, "there is no station to be taken");
  if (!now.axis) return tl::unexpected(now.axis.error());
  const StationTask task{model->stage(), *station, *now.axis};
  taking.add(task.what(), [this, task](const Progress& progress) { return take_station(task, progress); });
  return {};
}

Result<> LiveSession::Parts::undo() {
  const auto last = model->last();
  const auto aside = put_shot_aside(last->stage, last->station, last->places);
  if (!aside) return tl::unexpected(aside.error());
  model->remember(std::nullopt);
  board.forget(last->places);
  want_pose();
  model->log("info", fmt::format("{} undone; its images lie in undone/{}", last->what, aside->filename().string()));
  return model->reload();
}

Result<> LiveSession::Parts::finish() {
  const LiveStage stage = model->stage();
  computing.add(stage == LiveStage::kScan ? "the hole" : std::string(last_step(stage)),
                [this, stage](const Progress& progress) { return compute(stage, progress); });
  return {};
}

Result<> LiveSession::Parts::check() {
  const LiveActivity now = activity();
  if (!now.axis) return tl::unexpected(now.axis.error());
  const fs::path folder = model->job().folder / "check";
  const PairOfFiles places = {folder / "left.png", folder / "right.png"};
  taking.add("check of the head", [this, places, axis_mm = now.axis->position_mm](const Progress& progress) {
    return check_head(axis_mm, places, progress);
  });
  return {};
}

Result<> LiveSession::Parts::change_exposure(const json& command) {
  const auto exposure_s = number_of(command, "exposure_s");
  if (!exposure_s) return tl::unexpected(exposure_s.error());
  const auto gain = number_of(command, "gain");
  if (!gain) return tl::unexpected(gain.error());
  if (!taking.idle()) return base::fail(ErrorCode::kUsage, "images are being taken");
  for (devices::CameraSettings* settings : {&devices.preview, &devices.capture.settings}) {
    devices::CameraSettings wanted = *settings;
    wanted.exposure_s = *exposure_s;
    wanted.gain = *gain;
    if (auto valid = wanted.validate(); !valid) return valid;
    *settings = wanted;
  }
  return watch.start(devices.preview);
}

Result<> LiveSession::Parts::command(const std::string& text) {
  const std::lock_guard lock(commands);
  const json parsed = json::parse(text, nullptr, false);
  if (!parsed.is_object()) return base::fail(ErrorCode::kBadInput, "a command is a JSON object");
  const auto name = text_of(parsed, "command");
  if (!name) return tl::unexpected(name.error());
  if (*name == "stage") {
    const auto stage = text_of(parsed, "name");
    if (!stage) return tl::unexpected(stage.error());
    const auto known = live_stage_from_name(*stage);
    if (!known) return base::fail(ErrorCode::kBadInput, fmt::format("there is no stage '{}'", *stage));
    model->choose(*known);
    return {};
  }
  if (*name == "select") {
    const auto station = text_of(parsed, "station");
    return station ? model->select(*station) : tl::unexpected(station.error());
  }
  if (*name == "axis") {
    const auto position_mm = number_of(parsed, "position_mm");
    if (!position_mm) return tl::unexpected(position_mm.error());
    if (devices.typed == nullptr)
      return base::fail(ErrorCode::kUsage, "the axis is read from the machine; nothing is typed in");
    return devices.typed->enter(*position_mm);
  }
  if (*name == "exposure") return change_exposure(parsed);
  if (*name == "reconnect") {
    if (!taking.idle()) return base::fail(ErrorCode::kUsage, "images are being taken");
    return watch.start(devices.preview);
  }
  const std::string why_not = model->guidance(activity()).why_not(*name);
  if (!why_not.empty()) return base::fail(ErrorCode::kUsage, why_not);
  if (*name == "next") return next(false);
  if (*name == "repeat") return next(true);
  if (*name == "undo") return undo();
  if (*name == "finish") return finish();
  if (*name == "check") return check();
  if (taking.idle()) {
    computing.cancel();
  } else {
    taking.cancel();
  }
  return {};
}

Result<std::unique_ptr<LiveSession>> LiveSession::begin(const fs::path& job, LiveDevices devices, live::Feed& feed,
                                                        int threads) {
  auto model = LiveModel::read(job);
  if (!model) return base::fail(std::move(model));
  const auto markers = job_markers((*model)->job());
  if (!markers) return tl::unexpected(markers.error());
  auto parts = std::make_unique<Parts>(*std::move(model), *markers, std::move(devices), feed, threads);
  Parts& at = *parts;
  if (auto started = at.watch.start(at.devices.preview); !started)
    at.model->log("error", fmt::format("cameras: {}", started.error().message));
  at.computing.add("the board's images", [&at](const Progress& progress) { return at.look_at_boards(progress); });
  at.publisher = std::jthread([&at](const std::stop_token& stop) { at.publish(stop); });
  return std::unique_ptr<LiveSession>(new LiveSession(std::move(parts)));
}

LiveSession::LiveSession(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

LiveSession::~LiveSession() {
  parts_->taking.cancel();
  parts_->computing.cancel();
}

Result<> LiveSession::command(const std::string& json) { return parts_->command(json); }

}  // namespace crosstie::app
