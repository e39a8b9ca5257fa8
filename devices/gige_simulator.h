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

/// Writes the pixels of one exposure, row by row without padding. Called from the simulator's thread; must not throw.
using FillPixels = std::function<void(const GigeExposure&, std::span<std::byte>)>;

/// A GigE Vision camera made by Aravis that answers on one network address (GVCP, GVSP): what is seen through it went the way
/// that a real camera's images go. Its image is up to 2048 x 2048 px, its triggers are Software and Line0, its ids have 16 bits and begin
/// near their end. Destroying it is pulling its cable.
class GigeSimulator {
 public:
  virtual ~GigeSimulator() = default;
};

/// `address` is that of one of the host's interfaces. Its port is the standard's, UDP 3956: one camera for each address and host.
/// Errors: kDevice where the port is taken or the address is none of the host's.
base::Result<std::unique_ptr<GigeSimulator>> simulate_gige_camera(const std::string& address, const std::string& serial,
                                                                  FillPixels fill);

}  // namespace crosstie::devices
