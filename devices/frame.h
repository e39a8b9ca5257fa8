#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "base/image.h"
#include "devices/host_time.h"

namespace crosstie::devices {

/// What a frame says of itself beside its pixels.
struct FrameHeader {
  std::uint64_t id = 0;  ///< as the camera counts its exposures, from any begin; see FrameCheckOptions::id_bits
  std::chrono::nanoseconds
      device_time{};   ///< of the exposure on the camera's own clock, whose zero is anywhere; 0: it has none
  HostTime host_time;  ///< when the frame was complete on the host
};

struct Frame {
  FrameHeader header;
  base::Image image;
  std::string name;  ///< of the file it was read from; empty for cameras
};

/// The frames of two cameras that one trigger exposed.
struct FramePair {
  Frame left;
  Frame right;
};

}  // namespace crosstie::devices
