#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <thread>

#include "base/image.h"
#include "devices/camera_pair.h"
#include "devices/simulated_camera.h"

namespace crosstie::tests {

/// An image of one grey level.
inline base::Image grey_image(int width_px, int height_px, int level) {
  base::Image image(width_px, height_px, 8);
  for (int y = 0; y < height_px; ++y) std::fill_n(image.row<std::uint8_t>(y), width_px, static_cast<std::uint8_t>(level));
  return image;
}

/// Of an image of one level; -1 where there is none.
inline int grey_level(const base::Image& image) { return image.view().row<std::uint8_t>(0)[0]; }
inline int grey_level(const std::filesystem::path& path) {
  const auto image = base::read_image(path);
  return image ? grey_level(*image) : -1;
}

/// Two cameras that see one grey level each, which the test sets; held ones do not finish their exposures.
struct GreyCameras {
  std::atomic<int> level = 50;  ///< of the left one; the right one sees one more
  std::atomic<bool> held = false;
  std::atomic<int> losses = 0;  ///< of the right camera's next frames
  devices::SimulatedCamera left{"left", [this](const auto&) { return exposed(0); }};
  devices::SimulatedCamera right{"right", [this](const auto&) { return exposed(1); }};
  devices::CameraPair pair{left, right, {.max_host_skew_s = 0.5, .max_device_skew_s = 1.0}};

 private:
  base::Result<base::Image> exposed(int more) {
    while (held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (more == 1 && losses > 0) {
      --losses;
      return base::fail(base::ErrorCode::kDevice, "lost on its way");
    }
    return grey_image(64, 48, level + more);
  }
};

}  // namespace crosstie::tests
