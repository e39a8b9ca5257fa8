#include "live/preview_loop.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "devices/newest_queue.h"
#include "live/frame_counter.h"

namespace crosstie::live {
namespace {

constexpr std::size_t kWaiting = 2;    // pairs
constexpr double kLook_s = 0.1;        // how long a thread waits before it looks whether it is to end
constexpr double kRateWindow_s = 2.0;  // over which pictures are counted

using Drawn = base::Result<CameraPicture>;
using Preview = std::shared_ptr<const std::array<PreviewOptions, 2>>;  // shared: a family's list of codes may be long

/// A thread that draws one frame at a time beside its owner's.
class Helper {
 public:
  Helper() : thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void begin(const devices::Frame& frame, const PreviewOptions& options) {
    const std::lock_guard lock(mutex_);
    frame_ = &frame;
    options_ = &options;
    drawn_.reset();
    changed_.notify_all();
  }

  [[nodiscard]] Drawn wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return drawn_.has_value(); });
    return *std::exchange(drawn_, std::nullopt);
  }

 private:
  void run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (changed_.wait(lock, stop, [this] { return frame_ != nullptr; })) {
      const devices::Frame& frame = *std::exchange(frame_, nullptr);
      const PreviewOptions& options = *options_;
      lock.unlock();
      Drawn drawn = preview(frame, options);
      lock.lock();
      drawn_ = std::move(drawn);
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;
  const devices::Frame* frame_ = nullptr;
  const PreviewOptions* options_ = nullptr;
  std::optional<Drawn> drawn_;
  std::jthread thread_;
};

}  // namespace

/// One run, from start() to stop() or to the loss of a camera. The source's threads may keep its queue a little longer.
class PreviewLoop::Run {
 public:
  Run(PreviewLoop& loop, Preview preview) : loop_(loop), preview_(std::move(preview)) {}

  void begin() {
    thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
  }
  void end() {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
  }

  /// From the source's threads.
  void take(base::Result<devices::FramePair> pair) {
    if (pair) {
      const std::lock_guard lock(mutex_);
      counters_[0].add(pair->left.header);
      counters_[1].add(pair->right.header);
    }
    queue_.push(std::move(pair));
  }

  void set_preview(Preview preview) {
    const std::lock_guard lock(mutex_);
    preview_ = std::move(preview);
  }

  /// Known only when the cameras run.
  void set_id_bits(std::array<int, 2> id_bits) {
    const std::lock_guard lock(mutex_);
    for (std::size_t side = 0; side < 2; ++side) counters_[side].set_options({.id_bits = id_bits[side]});
  }

  [[nodiscard]] bool running() const { return running_; }

  [[nodiscard]] PreviewStatistics statistics(std::array<devices::CameraState, 2> states,
                                             const devices::FramePairingCounts& pairs) {
    const std::lock_guard lock(mutex_);
    PreviewStatistics result{.cameras = {}, .pairs = pairs};
    for (std::size_t side = 0; side < 2; ++side) {
      PreviewCamera& camera = result.cameras[side];
      camera.camera = std::move(states[side]);
      camera.shown = shown_;
      camera.dropped = queue_.dropped();
      const FrameFaults faults = counters_[side].faults();
      // A frame that arrived and had no partner, or the wrong one, is missing among the pairs, too.
      const std::uint64_t alone = pairs.unmatched[side] + pairs.contradicted;
      camera.lost = faults.lost > alone ? faults.lost - alone : 0;
      camera.swapped = faults.swapped;
      camera.rate_hz = rate_hz();
      camera.latency_ms = latency_ms_[side];
    }
    return result;
  }

 private:
  void work(const std::stop_token& stop) {
    Helper helper;
    while (!stop.stop_requested()) {
      auto next = queue_.pop(kLook_s);
      if (!next) return lose(std::move(next).error());
      if (!*next) continue;
      PreviewPair pair{.frames = std::move(**next), .pictures = {}};
      const Preview options = this->options();
      helper.begin(pair.frames.right, (*options)[1]);
      Drawn left = preview(pair.frames.left, (*options)[0]);
      Drawn right = helper.wait();
      for (Drawn* drawn : {&left, &right}) {
        if (!*drawn) return lose(std::move(*drawn).error());
      }
      pair.pictures = {*std::move(left), *std::move(right)};
      publish(pair);
      if (!stop.stop_requested()) loop_.sink_(std::move(pair));
    }
    running_ = false;
  }

  [[nodiscard]] Preview options() {
    const std::lock_guard lock(mutex_);
    return preview_;
  }

  void publish(PreviewPair& pair) {
    for (std::size_t side = 0; side < 2; ++side) loop_.feed_.pictures[side].publish(pair.pictures[side].jpeg);
    const devices::HostTime now = loop_.clock_();
    const std::lock_guard lock(mutex_);
    ++shown_;
    published_.push_back(now);
    forget(now);
    for (std::size_t side = 0; side < 2; ++side) {
      latency_ms_[side] = 1e3 * devices::seconds_between(pair.pictures[side].header.host_time, now);
      pair.pictures[side].latency_ms = latency_ms_[side];
    }
  }

  void lose(base::Error error) {
    running_ = false;
    loop_.sink_(tl::unexpected(std::move(error)));
  }

  /// Pictures that left the window.
  void forget(devices::HostTime now) {
    while (!published_.empty() && devices::seconds_between(published_.front(), now) > kRateWindow_s) published_.pop_front();
  }

  [[nodiscard]] double rate_hz() {
    forget(loop_.clock_());
    if (published_.size() < 2) return 0.0;
    const double passed_s = devices::seconds_between(published_.front(), published_.back());
    return passed_s > 0.0 ? static_cast<double>(published_.size() - 1) / passed_s : 0.0;
  }

  PreviewLoop& loop_;
  devices::NewestQueue<devices::FramePair> queue_{kWaiting};
  std::atomic<bool> running_ = true;
  std::mutex mutex_;  ///< of all below but the thread
  Preview preview_;
  std::array<FrameCounter, 2> counters_;
  std::deque<devices::HostTime> published_;
  std::uint64_t shown_ = 0;
  std::array<double, 2> latency_ms_ = {};
  std::jthread thread_;
};

PreviewLoop::PreviewLoop(devices::PairSource& source, Feed& feed, PreviewSink sink, std::array<PreviewOptions, 2> options,
                         devices::Clock clock)
    : source_(source),
      feed_(feed),
      sink_(std::move(sink)),
      clock_(std::move(clock)),
      preview_(std::make_shared<const std::array<PreviewOptions, 2>>(std::move(options))) {}

PreviewLoop::~PreviewLoop() { stop(); }

base::Result<devices::CameraSettings> PreviewLoop::start(const devices::CameraSettings& settings) {
  stop();
  const std::lock_guard starting(starting_);
  std::shared_ptr<Run> run;
  {
    const std::lock_guard lock(mutex_);
    for (const PreviewOptions& one : *preview_) {
      if (auto valid = one.validate(); !valid) return base::fail(std::move(valid));
    }
    run = run_ = std::make_shared<Run>(*this, preview_);
  }
  auto started = source_.start(settings, [run](base::Result<devices::FramePair> pair) { run->take(std::move(pair)); });
  if (!started) {
    const std::lock_guard lock(mutex_);
    run_.reset();
    return started;
  }
  const auto states = source_.states();
  run->set_id_bits({states[0].id_bits, states[1].id_bits});
  run->begin();
  return started;
}

void PreviewLoop::stop() {
  const std::lock_guard starting(starting_);
  source_.stop();
  std::shared_ptr<Run> run;
  {
    const std::lock_guard lock(mutex_);
    run = std::exchange(run_, nullptr);
  }
  if (run) run->end();
}

base::Result<> PreviewLoop::set_options(std::array<PreviewOptions, 2> options) {
  for (const PreviewOptions& one : options) {
    if (auto valid = one.validate(); !valid) return valid;
  }
  const std::lock_guard lock(mutex_);
  preview_ = std::make_shared<const std::array<PreviewOptions, 2>>(std::move(options));
  if (run_) run_->set_preview(preview_);
  return {};
}

PreviewStatistics PreviewLoop::statistics() {
  std::shared_ptr<Run> run;
  {
    const std::lock_guard lock(mutex_);
    run = run_;
  }
  const auto counts = source_.counts();
  if (run) return run->statistics(source_.states(), counts);
  PreviewStatistics result{.cameras = {}, .pairs = counts};
  auto states = source_.states();
  for (std::size_t side = 0; side < 2; ++side) result.cameras[side].camera = std::move(states[side]);
  return result;
}

bool PreviewLoop::running() const {
  const std::lock_guard lock(mutex_);
  return run_ && run_->running();
}

}  // namespace crosstie::live
