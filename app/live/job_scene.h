#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/live/live_status.h"
#include "base/machine.h"
#include "base/pose.h"

namespace crosstie::app {

/// A scanned station as the page draws it: some of its points, in the rig's frame.
struct ScenePatch {
  std::string station = {};
  double axis_mm = 0.0;
  std::vector<Eigen::Vector3d> p_in_rig_mm = {};
};

/// At most so many points of a patch are shown.
inline constexpr std::size_t kPatchPoints = 20'000;

/// Every so many-th point of a station's cloud. Errors of its file.
base::Result<ScenePatch> read_patch(const std::filesystem::path& scan_result, const std::string& station, double axis_mm);

/// A piece of the hole's edge.
struct RimPiece {
  std::vector<Eigen::Vector3d> p_in_machine_mm = {};
  bool gap = false;  ///< the chord over a part that nobody saw
};

/// The edge in a result folder of `edge`; nothing where there is none.
std::vector<RimPiece> read_rim(const std::filesystem::path& edge_result);

/// What stands in the 3D view.
struct LiveScene {
  std::uint64_t version = 0;
  std::string frame = {};                  ///< machine, or rig as long as the machine is not commissioned
  std::vector<MarkerStatus> markers = {};  ///< with xyz_mm in that frame
  struct PlacedPatch {
    const ScenePatch* patch = nullptr;
    base::Pose frame_from_rig = {};
  };
  std::vector<PlacedPatch> patches = {};
  std::vector<RimPiece> rim = {};
  std::optional<base::Pose> frame_from_head = {};
};

/// The scene as the page reads it (docs/live.md), one line of JSON.
std::string scene_json(const LiveScene& scene);

}  // namespace crosstie::app
