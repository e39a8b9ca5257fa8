#pragma once

#include <array>
#include <filesystem>
#include <memory>

#include "app/live/live_session.h"
#include "base/result.h"
#include "devices/axis_reader.h"
#include "devices/camera_device.h"
#include "devices/camera_pair.h"
#include "devices/pattern_sequencer.h"

namespace crosstie::app {

/// Devices that are open, and what a session needs of them.
struct OpenDevices {
  std::array<std::unique_ptr<devices::CameraDevice>, 2> cameras;  ///< none where pairs are files
  std::unique_ptr<devices::PairSource> pairs;
  std::unique_ptr<devices::AxisReader> axis;
  std::unique_ptr<devices::PatternSequencer> projector;  ///< none: nothing is scanned
  LiveDevices live;                                      ///< points to the ones above
};

/// Opens the devices of a machine as a file describes them (docs/formats.md, "crosstie-devices/1"). Errors: kFileSystem, kBadInput with file
/// and line, and those of the devices.
base::Result<OpenDevices> open_devices(const std::filesystem::path& file);

/// The images in a folder of `patterns`, which must be of the sequence that a job asks for.
PatternImages patterns_in(const std::filesystem::path& folder);

}  // namespace crosstie::app
