#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/result.h"
#include "devices/camera_device.h"

namespace crosstie::devices {

/// What a simulated GigE Vision camera exposes now, after the settings that its user wrote into it.
struct GigeExposure {
  int width_px = 0;
  int height_px = 0;
  PixelFormat format = PixelFormat::kMono8;  ///< kMono8 or kMono16 (little endian), which is what it offers
  double exposure_s = 0.0;
  double gain = 0.0;
};

/// Writes the pixels of one exposure, row by row without padding. Called from the simulator's thread; must not throw, and must not wait:
/// meanwhile the camera answers nobody, and after three seconds its user takes it for lost.
using FillPixels = std::function<void(const GigeExposure&, std::span<std::byte>)>;

/// A GigE Vision camera that answers on one network address (GVCP, GVSP): what is seen through it went the way that a real camera's
/// images go. Its registers and their description (GenICam) are those of Aravis's fake camera: an image of up to 2048 x 2048 px, the
/// triggers Software and Line0 (which nobody pulls), ids of 16 bits that begin near their end. A software trigger is exposed before it is
/// acknowledged: what is changed in front of the camera after trigger() returned is not in its image. Frames leave at the pace of a
/// link of 1 Gbit/s, and packets of the latest one are sent again where they are asked for. One user controls it, others are
/// refused; without a sign of life within its heartbeat the control is free again. Destroying it is pulling its cable.
class GigeSimulator {
 public:
  virtual ~GigeSimulator() = default;
};

/// `address` is one of the host's, in dotted decimals; all of 127.0.0.0/8 is its own on Linux. Its port is the standard's, UDP 3956: one
/// camera for each address and host. Errors: kUsage without an address or serial number, kDevice where the port is taken or the
/// address is none of the host's.
base::Result<std::unique_ptr<GigeSimulator>> simulate_gige_camera(const std::string& address, const std::string& serial,
                                                                  FillPixels fill);

}  // namespace crosstie::devices
