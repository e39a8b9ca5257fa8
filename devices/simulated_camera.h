#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "devices/camera_device.h"

namespace crosstie::devices {

/// One exposure of a simulated camera.
struct SimulatedExposure {
  std::uint64_t id = 0;  ///< from 1
  HostTime time;
  CameraSettings settings;
};

/// What the camera sees. The image's bits must be those of the settings' format (its white level is set). An error loses this frame:
/// its id is missing from what is delivered.
using RenderFrame = std::function<base::Result<base::Image>(const SimulatedExposure&)>;

/// A camera whose images are computed: the digital twin's. Triggered frames are delivered within trigger(), which also stands for the
/// pulse of a hardware trigger; free-running ones from a thread of its own, where frame_rate_hz must be stated. Its device time is
/// `clock` plus `device_offset`.
class SimulatedCamera : public CameraDevice {
 public:
  SimulatedCamera(std::string name, RenderFrame render, Clock clock = host_now, std::chrono::nanoseconds device_offset = {});
  ~SimulatedCamera() override;

  base::Result<CameraSettings> start(const CameraSettings& settings, FrameSink sink) override;
  void stop() override;
  base::Result<> trigger() override;
  [[nodiscard]] CameraState state() override;

  /// What state() says of its temperature from now on; nothing: it has no sensor, as at first.
  void set_temperature(std::optional<double> temperature_c);

  /// As if its cable were pulled: the sink gets the error, nothing comes any more until it is started again.
  void unplug();

 private:
  void expose();
  void run(const std::stop_token& stop);

  std::string name_;
  RenderFrame render_;
  Clock clock_;
  std::chrono::nanoseconds device_offset_;
  std::mutex mutex_;  ///< of all below; held while a frame is delivered, so that stop() ends deliveries
  std::condition_variable_any stopped_;
  CameraSettings settings_;
  FrameSink sink_;
  CameraState state_;
  std::optional<double> temperature_c_;
  std::uint64_t exposures_ = 0;
  std::jthread thread_;
};

}  // namespace crosstie::devices
