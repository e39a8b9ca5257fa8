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

Result<CameraSettings> TappedPairs::start(const CameraSettings& settings, devices::PairSink sink) {
  {
    const std::lock_guard lock(mutex_);
    sink_ = std::move(sink);
    wanted_ = settings;
  }
  return run(settings);
}

void TappedPairs::stop() {
  source_->stop();
  const std::lock_guard lock(mutex_);
  running_.reset();
}

Result<> TappedPairs::measure(const CameraSettings& settings) {
  {
    const std::lock_guard lock(mutex_);
    if (!running_) return base::fail(ErrorCode::kDevice, "the cameras do not run; connect them first");
  }
  source_->stop();
  auto ran = run(settings);
  return ran ? Result<>() : base::fail(std::move(ran));
}

Result<> TappedPairs::preview() {
  std::optional<CameraSettings> wanted;
  {
    const std::lock_guard lock(mutex_);
    wanted = wanted_;
  }
  if (!wanted) return {};
  source_->stop();
  auto ran = run(*wanted);
  return ran ? Result<>() : base::fail(std::move(ran));
}

std::optional<CameraSettings> TappedPairs::settings() {
  const std::lock_guard lock(mutex_);
  return running_;
}

Result<CameraSettings> TappedPairs::run(const CameraSettings& settings) {
  auto took = source_->start(settings, [this](Result<FramePair> pair) { deliver(std::move(pair)); });
  const std::lock_guard lock(mutex_);
  running_ = took ? std::optional(*took) : std::nullopt;
  return took;
}

void TappedPairs::deliver(Result<FramePair> pair) {
  devices::PairSink sink;
  {
    const std::lock_guard lock(mutex_);
    if (!pair) running_.reset();
    const bool in_time = !pair || (after_ && pair->left.header.host_time > *after_ && pair->right.header.host_time > *after_);
    if (after_ && in_time && !taken_) {
      taken_ = pair;
      changed_.notify_all();
    }
    sink = sink_;
  }
  if (sink) sink(std::move(pair));
}

Result<FramePair> TappedPairs::take(HostTime after, double timeout_s, const base::Progress& progress) {
  bool triggered = false;
  {
    const std::lock_guard lock(mutex_);
    if (!running_) return base::fail(ErrorCode::kDevice, "the cameras do not run; connect them first");
    triggered = running_->trigger == devices::TriggerMode::kSoftware;
    after_ = after;
    taken_.reset();
  }
  if (triggered) {
    if (auto sent = source_->trigger(); !sent) return base::fail(std::move(sent));
  }
  const HostTime end = devices::host_now() + devices::to_nanoseconds(timeout_s);
  std::unique_lock lock(mutex_);
  while (!taken_ && devices::host_now() < end && !progress.cancelled())
    changed_.wait_for(lock, std::chrono::milliseconds(50), [this] { return taken_.has_value(); });
  after_.reset();
  if (taken_) return *std::exchange(taken_, std::nullopt);
  if (progress.cancelled()) return base::cancelled("taking a pair");
  return base::fail(ErrorCode::kDevice,
                    fmt::format("no pair of images came within {:.1f} s{}", timeout_s, triggered ? " after the trigger" : ""));
}

}  // namespace crosstie::app
