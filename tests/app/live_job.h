#pragma once

#include <string>

namespace crosstie::tests {

/// A job.toml with a board, a head, a cross and these [[station]] tables; none of its files is there.
inline std::string live_job(const std::string& stations) {
  return R"(format = "crosstie-job/1"
name = "door"
[board]
corners = [5, 4]
pitch_mm = 30.0
[camera.left]
board_images = "board/left/*.png"
[camera.right]
board_images = "board/right/*.png"
[rig]
cameras = ["left", "right"]
[cross]
points = "cross/points.csv"
spheres = "cross/spheres.csv"
[machine]
probed_spheres = "machine/probe.csv"
axis_sigma_mm = 0.005

)" + stations;
}

}  // namespace crosstie::tests
