#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "devices/camera_device.h"

namespace crosstie::devices {

/// A GenICam camera that answered.
struct FoundCamera {
  std::string id;  ///< for open_aravis_camera
  std::string vendor;
  std::string model;
  std::string serial;
  std::string address;   ///< of its network interface, or its place on the USB
  std::string protocol;  ///< "GigEVision", "USB3Vision", ...
};

/// Asks on all network interfaces and the USB; takes about a second.
[[nodiscard]] std::vector<FoundCamera> find_aravis_cameras();

/// A GigE Vision or USB3 Vision camera through Aravis (GenICam, SFNC feature names).
///
/// `id` is that of FoundCamera, a serial number or an IP address. start() sets exposure, gain, format, trigger and region, switches
/// ExposureAuto, GainAuto, BlackLevelAuto and gamma off where the camera has them, and reads back what it took. Mono12 comes
/// unpacked, as Mono12p or as Mono12Packed, whichever the camera has.
/// CameraState::temperature_c is SFNC's DeviceTemperature, read every ten seconds while the camera runs, where it has that.
/// A frame's time is that of its arrival. Frames of which packets are missing are counted and not delivered. A camera that stops to answer is
/// reported within about six seconds (Aravis's heartbeat); stop() then waits some seconds more, for requests that nobody answers.
/// start() connects to it again.
/// Errors: kDevice where no such camera answers, or another program controls it.
base::Result<std::unique_ptr<CameraDevice>> open_aravis_camera(const std::string& id, Clock clock = host_now);

}  // namespace crosstie::devices
