#include "devices/simulated_camera.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace crosstie::devices {

using base::ErrorCode;

SimulatedCamera::SimulatedCamera(std::string name, RenderFrame render, Clock clock, std::chrono::nanoseconds device_offset)
    : name_(std::move(name)), render_(std::move(render)), clock_(std::move(clock)), device_offset_(device_offset) {
  state_.name = name_;
}

SimulatedCamera::~SimulatedCamera() { stop(); }

base::Result<CameraSettings> SimulatedCamera::start(const CameraSettings& settings, FrameSink sink) {
  if (auto valid = settings.validate(); !valid) return base::fail(std::move(valid));
  if (settings.trigger == TriggerMode::kFreeRunning && settings.frame_rate_hz == 0.0) {
    return base::fail(ErrorCode::kUsage, fmt::format("{}: running freely it needs a frame rate", name_));
  }
  if (state().running) return base::fail(ErrorCode::kUsage, fmt::format("{} is running already", name_));
  stop();  // the thread of a run that ended by itself
  const std::lock_guard lock(mutex_);
  settings_ = settings;
  sink_ = std::move(sink);
  state_ = {.name = name_, .running = true};
  if (settings.trigger == TriggerMode::kFreeRunning) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  return settings;
}

void SimulatedCamera::stop() {
  std::jthread ending;
  {
    const std::lock_guard lock(mutex_);
    state_.running = false;
    sink_ = nullptr;
    ending = std::move(thread_);
  }
  ending.request_stop();
}

base::Result<> SimulatedCamera::trigger() {
  const std::lock_guard lock(mutex_);
  if (!state_.running) return base::fail(ErrorCode::kDevice, fmt::format("{} is not running", name_));
  if (settings_.trigger == TriggerMode::kFreeRunning) {
    return base::fail(ErrorCode::kUsage, fmt::format("{} runs freely and takes no trigger", name_));
  }
  expose();
  return {};
}

CameraState SimulatedCamera::state() {
  const std::lock_guard lock(mutex_);
  CameraState state = state_;
  state.temperature_c = temperature_c_;
  return state;
}

void SimulatedCamera::set_temperature(std::optional<double> temperature_c) {
  const std::lock_guard lock(mutex_);
  temperature_c_ = temperature_c;
}

void SimulatedCamera::unplug() {
  const std::lock_guard lock(mutex_);
  if (!state_.running) return;
  state_.running = false;
  state_.trouble = fmt::format("{}: the camera is lost", name_);
  sink_(base::fail(ErrorCode::kDevice, state_.trouble));
}

void SimulatedCamera::expose() {
  const HostTime time = clock_();
  const SimulatedExposure exposure{++exposures_, time, settings_};
  base::Result<base::Image> image = render_(exposure);
  if (!image) {
    ++state_.incomplete;
    return;
  }
  if (image->bits() != storage_bits(settings_.format)) {
    state_.running = false;
    state_.trouble = fmt::format("{}: rendered {} bits for {}", name_, image->bits(), pixel_format_name(settings_.format));
    return sink_(base::fail(ErrorCode::kInternal, state_.trouble));
  }
  image->set_white_level(white_level(settings_.format));
  ++state_.frames;
  sink_(Frame{{exposure.id, time.time_since_epoch() + device_offset_, time}, *std::move(image), {}});
}

void SimulatedCamera::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  const auto period = to_nanoseconds(1.0 / settings_.frame_rate_hz);
  auto next = std::chrono::steady_clock::now();
  while (state_.running && !stop.stop_requested()) {
    expose();
    next = std::max(next + period, std::chrono::steady_clock::now());
    stopped_.wait_until(lock, stop, next, [&] { return !state_.running; });
  }
}

}  // namespace crosstie::devices
