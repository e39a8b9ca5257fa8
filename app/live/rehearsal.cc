#include "app/live/rehearsal.h"

#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "devices/aravis_camera.h"
#include "devices/axis_stream.h"
#include "fixtures/live_devices.h"
#include "fixtures/simulate.h"
#include "scan/patterns.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using fixtures::TwinPlace;

/// What the session waits for: the helper does it.
struct Errand {
  TwinPlace place;
  std::optional<double> axis_mm;

  bool operator==(const Errand&) const = default;
};

/// The axis as the operator may read it: not while the helper is under way.
class WatchedAxis : public devices::AxisReader {
 public:
  WatchedAxis(devices::AxisReader& axis, const std::atomic<bool>& under_way) : axis_(&axis), under_way_(&under_way) {}
  [[nodiscard]] devices::AxisState state() override {
    devices::AxisState state = axis_->state();
    if (*under_way_) {
      state.latest.reset();
      state.trouble = "the beam moves";
    }
    return state;
  }

 private:
  devices::AxisReader* axis_;
  const std::atomic<bool>* under_way_;
};

class TwinRehearsal : public Rehearsal {
 public:
  Result<> open(const std::string& scene_name, std::uint64_t seed, const fs::path& job, Session& session);
  LiveDevices devices() override;

 private:
  void want(LiveStage stage, int have, const std::string& station);
  void run_errands(const std::stop_token& stop);

  std::unique_ptr<fixtures::TwinMachine> twin_;
  std::array<std::unique_ptr<devices::GigeSimulator>, 2> simulators_;
  std::unique_ptr<fixtures::AxisServer> axis_server_;
  std::array<std::unique_ptr<devices::CameraDevice>, 2> cameras_;
  std::unique_ptr<devices::CameraPair> pairs_;
  std::unique_ptr<devices::AxisReader> axis_;
  std::atomic<bool> under_way_ = false;
  std::unique_ptr<WatchedAxis> watched_axis_;
  std::unique_ptr<devices::PatternSequencer> projector_;
  std::mutex mutex_;  ///< of the two below
  std::condition_variable_any changed_;
  std::optional<Errand> errand_;
  std::jthread helper_;  ///< last: ends first
};

Result<> TwinRehearsal::open(const std::string& scene_name, std::uint64_t seed, const fs::path& job, Session& session) {
  const auto scene = fixtures::find_scene(scene_name);
  if (!scene) return tl::unexpected(scene.error());
  std::error_code none;
  if (!fs::exists(job / "job.toml", none)) {
    const fixtures::SimulateOptions options{.seed = seed, .threads = session.threads(), .head_photographs = false};
    if (auto made = fixtures::simulate(*scene, job, options, session.progress()); !made) return made;
  }
  auto twin = fixtures::TwinMachine::make(*scene, {.seed = seed, .threads = session.threads()}, session.progress());
  if (!twin) return base::fail(std::move(twin));
  twin_ = *std::move(twin);
  auto simulators = fixtures::plug_in_cameras(*twin_);
  if (!simulators) return base::fail(std::move(simulators));
  simulators_ = *std::move(simulators);
  auto server = fixtures::AxisServer::start(*twin_);
  if (!server) return base::fail(std::move(server));
  axis_server_ = *std::move(server);
  for (const std::size_t side : {std::size_t{0}, std::size_t{1}}) {
    auto camera = devices::open_aravis_camera(fixtures::kTwinAddresses[side]);
    if (!camera) return base::fail(std::move(camera));
    cameras_[side] = *std::move(camera);
  }
  // Two software triggers are as far apart as a busy computer makes them.
  pairs_ = std::make_unique<devices::CameraPair>(
      *cameras_[0], *cameras_[1], devices::FramePairingOptions{.max_host_skew_s = 0.040, .max_device_skew_s = 0.5});
  devices::TcpAxisOptions axis{.host = "127.0.0.1", .port = axis_server_->port()};
  axis.dialogue.line.label = "X";
  auto reader = devices::connect_tcp_axis(axis);
  if (!reader) return base::fail(std::move(reader));
  axis_ = *std::move(reader);
  watched_axis_ = std::make_unique<WatchedAxis>(*axis_, under_way_);
  if (twin_->scene().projector) projector_ = fixtures::twin_projector(*twin_);
  helper_ = std::jthread([this](const std::stop_token& stop) { run_errands(stop); });
  return {};
}

LiveDevices TwinRehearsal::devices() {
  LiveDevices live;
  live.pairs = pairs_.get();
  live.axis = watched_axis_.get();
  live.projector = projector_.get();
  live.pattern_images = [this](const base::PatternSequence& wanted) -> Result<std::vector<base::Image>> {
    const auto& options = twin_->scene().patterns;
    if (!options) return base::fail(ErrorCode::kUsage, "the scene has no patterns");
    std::vector<base::Image> images;
    for (const base::Pattern& pattern : wanted.patterns) images.push_back(scan::render_pattern(*options, wanted, pattern));
    return images;
  };
  const std::shared_ptr<const fixtures::Irradiance> light = twin_->light(0);
  live.capture.settings.width_px = light->width;
  live.capture.settings.height_px = light->height;
  live.capture.settings.format = twin_->sensor(0).bits > 8 ? devices::PixelFormat::kMono16 : devices::PixelFormat::kMono8;
  live.capture.settings.trigger = devices::TriggerMode::kSoftware;
  live.capture.timeout_s = 20.0;  // its light is computed
  live.preview = live.capture.settings;
  live.wanted = [this](LiveStage stage, int have, const std::string& station) { want(stage, have, station); };
  return live;
}

/// The helper looks at the page and sees what is wanted.
void TwinRehearsal::want(LiveStage stage, int have, const std::string& station) {
  const fixtures::Scene& scene = twin_->scene();
  Errand errand;
  if (stage == LiveStage::kCalibrate) {
    if (!scene.board || scene.board->rig_from_board.empty()) return;
    errand.place = {TwinPlace::Object::kBoard, have % static_cast<int>(scene.board->rig_from_board.size())};
  } else {
    if (!scene.machine) return;
    errand.place.object = stage == LiveStage::kCommission ? TwinPlace::Object::kCross : TwinPlace::Object::kWall;
    for (const fixtures::Station& one : scene.machine->stations) {
      if (one.name == station) errand.axis_mm = one.axis_mm;
    }
  }
  const std::lock_guard lock(mutex_);
  if (errand_ && *errand_ == errand) return;
  errand_ = errand;
  under_way_ = true;
  changed_.notify_all();
}

void TwinRehearsal::run_errands(const std::stop_token& stop) {
  std::optional<Errand> done;
  while (!stop.stop_requested()) {
    Errand errand;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return errand_ && !(done && *done == *errand_); })) return;
      errand = *errand_;
    }
    base::Progress progress;
    progress.stop = stop;
    (void)twin_->lamps_on(progress);  // a scan leaves the projector as its last pattern
    // What the scene does not have is not brought: the page shows what stands there instead.
    (void)twin_->place(errand.place, progress);
    if (errand.axis_mm) (void)twin_->move_to(*errand.axis_mm, progress);
    done = errand;
    const std::lock_guard lock(mutex_);
    if (*done == *errand_) under_way_ = false;
  }
}

}  // namespace

Result<std::unique_ptr<Rehearsal>> begin_rehearsal(const std::string& scene, std::uint64_t seed, const fs::path& job,
                                                   Session& session) {
  auto rehearsal = std::make_unique<TwinRehearsal>();
  if (auto opened = rehearsal->open(scene, seed, job, session); !opened) return base::fail(std::move(opened));
  return std::unique_ptr<Rehearsal>(std::move(rehearsal));
}

}  // namespace crosstie::app
