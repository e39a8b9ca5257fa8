#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "devices/frame.h"

namespace crosstie::devices {

/// How pixels come: bits per pixel of the sensor's grey levels. Mono8 frames are 8-bit images, the others 16-bit ones whose white
/// level is 4095 or 65535.
enum class PixelFormat { kMono8, kMono12, kMono16 };

[[nodiscard]] std::string_view pixel_format_name(PixelFormat format);  ///< "Mono8", "Mono12", "Mono16"
[[nodiscard]] int storage_bits(PixelFormat format);
[[nodiscard]] double white_level(PixelFormat format);

/// What starts an exposure.
enum class TriggerMode {
  kFreeRunning,  ///< the camera's own clock
  kSoftware,     ///< trigger(); not accurate in time
  kHardware,     ///< an edge on `trigger_line`, which both cameras of a pair and the projector share
};

/// Nothing adapts itself: exposure and gain are fixed and gamma is off, since the noise model and the phases need linear, equal images.
struct CameraSettings {
  double exposure_s = 0.010;
  double gain = 0.0;  ///< in the camera's own unit, dB after SFNC
  PixelFormat format = PixelFormat::kMono8;
  TriggerMode trigger = TriggerMode::kFreeRunning;
  std::string trigger_line = "Line1";  ///< of kHardware, SFNC's TriggerSource
  bool rising_edge = true;             ///< of kHardware; false: the falling one
  double frame_rate_hz = 0.0;          ///< of kFreeRunning; 0: as the camera stands
  int width_px = 0;                    ///< of the region read, from the sensor's first pixel; 0: as the camera stands
  int height_px = 0;

  [[nodiscard]] base::Result<> validate() const;
  bool operator==(const CameraSettings&) const = default;
};

struct CameraState {
  std::string name;
  bool running = false;
  std::uint64_t frames = 0;                  ///< delivered since start()
  std::uint64_t incomplete = 0;              ///< frames of which a part did not arrive; they are not delivered
  int id_bits = 64;                          ///< in which it counts its frames, FrameCheckOptions::id_bits
  std::string trouble = {};                  ///< why nothing comes any more; empty: nothing is known to be wrong
  std::optional<double> temperature_c = {};  ///< inside of the camera; nothing where it does not tell
};

/// Takes frames from a camera's thread: it must not wait long and must not call the camera. An error, once and last, says that the
/// camera is lost.
using FrameSink = std::function<void(base::Result<Frame>)>;

/// A source of frames.
class CameraDevice {
 public:
  virtual ~CameraDevice() = default;
  /// Begins to deliver; returns the settings as the camera took them, e.g. with a rounded exposure. Error kUsage for settings out of
  /// their domain or a camera that runs already, kDevice for settings that the camera refuses or changes by more than 5 %.
  virtual base::Result<CameraSettings> start(const CameraSettings& settings, FrameSink sink) = 0;
  /// After it the sink is not called any more. Also for a camera that is lost or not running.
  virtual void stop() = 0;
  /// One exposure; needs TriggerMode::kSoftware.
  virtual base::Result<> trigger() = 0;
  [[nodiscard]] virtual CameraState state() = 0;
};

}  // namespace crosstie::devices
