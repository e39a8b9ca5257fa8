#include "app/live/tapped_pairs.h"

#include <chrono>
#include <utility>

#include <fmt/core.h>

namespace crosstie::app {

using base::ErrorCode;
using base::Result;
using devices::CameraSettings;
using devices::FramePair;
using devices::HostTime;

namespace {

constexpr double kSlowTransfer_s = 1.0;  // after which a pair that was triggered is not waited for any more

bool on_software_trigger(const std::optional<CameraSettings>& settings) {
  return settings && settings->trigger == devices::TriggerMode::kSoftware;
}

}  // namespace

TappedPairs::TappedPairs(devices::PairSource& source, double preview_hz)
    : source_(&source), preview_hz_(preview_hz), trigger_([this](const std::stop_token& stop) { trigger_preview(stop); }) {}

TappedPairs::~TappedPairs() {
  trigger_.request_stop();
  trigger_.join();
  source_->stop();
}

Result<CameraSettings> TappedPairs::start(const CameraSettings& settings, devices::PairSink sink) {
  {
    const std::lock_guard lock(mutex_);
    sink_ = std::move(sink);
    wanted_ = settings;
    measuring_ = lost_ = false;
  }
  source_->stop();  // also what is left of cameras that were lost
  return run(settings);
}

void TappedPairs::stop() {
  source_->stop();
  const std::lock_guard lock(mutex_);
  running_.reset();
}

Result<> TappedPairs::measure(const CameraSettings& settings) {
  {
    std::unique_lock lock(mutex_);
    if (!running_) return base::fail(ErrorCode::kDevice, "the cameras do not run; connect them first");
    measuring_ = true;
    await_pairs(lock);
  }
  return change_to(settings);
}

/// Waits for pairs that were triggered; those that do not come in time are lost. Call with the mutex held while the cameras run.
void TappedPairs::await_pairs(std::unique_lock<std::mutex>& lock, const base::Progress& progress) {
  const HostTime end = devices::host_now() + devices::to_nanoseconds(kSlowTransfer_s + running_->exposure_s);
  while (running_ && under_way_ > 0 && devices::host_now() < end && !progress.cancelled())
    changed_.wait_for(lock, std::chrono::milliseconds(50), [this] { return under_way_ == 0 || !running_; });
  if (!progress.cancelled()) under_way_ = 0;
}

Result<> TappedPairs::preview() {
  std::optional<CameraSettings> wanted;
  {
    const std::lock_guard lock(mutex_);
    if (!lost_) wanted = wanted_;
  }
  Result<> changed = wanted ? change_to(*wanted) : Result<>();
  const std::lock_guard lock(mutex_);
  measuring_ = false;
  changed_.notify_all();
  return changed;
}

Result<> TappedPairs::change_to(const CameraSettings& settings) {
  {
    const std::lock_guard lock(mutex_);
    if (running_ && asked_ && *asked_ == settings) return {};
  }
  source_->stop();
  auto ran = run(settings);
  return ran ? Result<>() : base::fail(std::move(ran));
}

/// Cameras that are triggered show what they see at the preview's rate, or as fast as pairs arrive.
void TappedPairs::trigger_preview(const std::stop_token& stop) {
  const auto period = devices::to_nanoseconds(1.0 / preview_hz_);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    if (!changed_.wait(lock, stop, [this] { return on_software_trigger(running_) && !measuring_; })) return;
    const HostTime next = devices::host_now() + period;
    ++under_way_;
    lock.unlock();
    const bool sent = source_->trigger().has_value();  // a camera that is lost tells so through its sink
    lock.lock();
    if (sent)
      changed_.wait_for(lock, stop, devices::to_nanoseconds(kSlowTransfer_s), [this] { return under_way_ == 0 || measuring_; });
    if (!measuring_ || !sent) under_way_ = 0;
    changed_.wait_until(lock, stop, next, [this] { return measuring_; });
  }
}

std::optional<CameraSettings> TappedPairs::settings() {
  const std::lock_guard lock(mutex_);
  return running_;
}

Result<CameraSettings> TappedPairs::run(const CameraSettings& settings) {
  auto took = source_->start(settings, [this](Result<FramePair> pair) { deliver(std::move(pair)); });
  const std::lock_guard lock(mutex_);
  running_ = took ? std::optional(*took) : std::nullopt;
  asked_ = settings;
  under_way_ = 0;
  changed_.notify_all();
  return took;
}

void TappedPairs::deliver(Result<FramePair> pair) {
  devices::PairSink sink;
  {
    const std::lock_guard lock(mutex_);
    if (!pair) {
      running_.reset();
      lost_ = true;
    }
    if (under_way_ > 0) --under_way_;
    const bool in_time = !pair || (after_ && pair->left.header.host_time > *after_ && pair->right.header.host_time > *after_);
    if (after_ && in_time && !taken_) taken_ = pair;
    changed_.notify_all();
    sink = sink_;
  }
  if (sink) sink(std::move(pair));
}

Result<FramePair> TappedPairs::take(HostTime after, double timeout_s, const base::Progress& progress) {
  std::chrono::nanoseconds patience{};  // after which a trigger or a frame is taken for lost
  bool triggered = false;
  {
    std::unique_lock lock(mutex_);
    if (!running_) return base::fail(ErrorCode::kDevice, "the cameras do not run; connect them first");
    if (on_software_trigger(running_)) await_pairs(lock, progress);  // of a trigger that was repeated
    if (!running_) return base::fail(ErrorCode::kDevice, "the cameras are lost; connect them again");
    triggered = on_software_trigger(running_);
    patience = devices::to_nanoseconds(kSlowTransfer_s + running_->exposure_s);
    if (running_->trigger == devices::TriggerMode::kFreeRunning) after += devices::to_nanoseconds(running_->exposure_s);
    after_ = after;
    taken_.reset();
  }
  const HostTime end = devices::host_now() + devices::to_nanoseconds(timeout_s);
  HostTime next_trigger = devices::host_now();
  std::unique_lock lock(mutex_);
  while (!taken_ && devices::host_now() < end && !progress.cancelled()) {
    if (triggered && devices::host_now() >= next_trigger) {
      next_trigger = devices::host_now() + patience;
      ++under_way_;
      lock.unlock();
      const auto sent = source_->trigger();
      lock.lock();
      if (!sent && !taken_) {
        after_.reset();
        return tl::unexpected(sent.error());
      }
    }
    changed_.wait_for(lock, std::chrono::milliseconds(50), [this] { return taken_.has_value(); });
  }
  after_.reset();
  if (taken_) return *std::exchange(taken_, std::nullopt);
  if (progress.cancelled()) return base::cancelled("taking a pair");
  return base::fail(ErrorCode::kDevice, fmt::format("no pair of images came within {:.1f} s{}", timeout_s,
                                                    triggered ? ", triggered again and again" : ""));
}

}  // namespace crosstie::app
