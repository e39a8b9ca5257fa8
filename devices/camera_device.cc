#include "devices/camera_device.h"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

namespace crosstie::devices {

using base::ErrorCode;

std::string_view pixel_format_name(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return "Mono8";
    case PixelFormat::kMono12:
      return "Mono12";
    case PixelFormat::kMono16:
      return "Mono16";
  }
  return "";
}

int storage_bits(PixelFormat format) { return format == PixelFormat::kMono8 ? 8 : 16; }

double white_level(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return 255.0;
    case PixelFormat::kMono12:
      return 4095.0;
    case PixelFormat::kMono16:
      return 65535.0;
  }
  return 0.0;
}

base::Result<> CameraSettings::validate() const {
  if (!(exposure_s > 0.0) || exposure_s > 60.0) {
    return base::fail(ErrorCode::kUsage, fmt::format("camera: an exposure of {} s; above 0 and up to 60 s", exposure_s));
  }
  if (!std::isfinite(gain)) return base::fail(ErrorCode::kUsage, fmt::format("camera: a gain of {}", gain));
  if (!(frame_rate_hz >= 0.0) || frame_rate_hz > 1e5) {
    return base::fail(ErrorCode::kUsage, fmt::format("camera: a frame rate of {} Hz; 0 to 1e5 Hz", frame_rate_hz));
  }
  if (trigger == TriggerMode::kHardware && trigger_line.empty()) {
    return base::fail(ErrorCode::kUsage, "camera: a hardware trigger needs the name of its line");
  }
  if (width_px < 0 || height_px < 0 || (width_px == 0) != (height_px == 0)) {
    return base::fail(ErrorCode::kUsage, fmt::format("camera: a region of {} x {} px; both or none", width_px, height_px));
  }
  return {};
}

}  // namespace crosstie::devices
