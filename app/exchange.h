#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/camera.h"
#include "base/cloud.h"
#include "base/colmap_model.h"
#include "base/network.h"
#include "base/point_list.h"
#include "base/pose.h"
#include "base/result.h"
#include "base/tool_path.h"

namespace crosstie::app {

/// A list of points with the frame it is in, where that is known.
struct FramedPoints {
  std::string frame;
  base::PointList list;
};

/// A camera with its place among others, where that is known.
struct PlacedCamera {
  std::string name;  ///< empty: the file holds one camera, without a name
  base::Camera camera;
  std::optional<base::Pose> camera_from_rig = {};  ///< translation in mm
};

/// What a file or folder of the exchange holds.
using Exchanged = std::variant<FramedPoints, std::vector<PlacedCamera>, base::AdjustedNetwork, base::ColmapModel, base::Cloud,
                               base::ToolPath>;

/// What is possible, for messages and for the help.
inline constexpr const char* kConversions =
    "list of points (.csv, .txt, .obc) -> .csv .txt .obc .ply .pcd; cloud (.ply, .pcd) -> .ply .pcd .csv .txt; "
    "cameras (.cameramodel, .yaml, .yml, kalibr's chain; result of calibrate or commission) -> .cameramodel .yaml .yml, or "
    "A.yml,B.yml "
    "(OpenCV's stereo pair); result of adjust (folder or result.json) and COLMAP folder -> points, a camera or a COLMAP "
    "folder; "
    "path.json -> .csv .dxf .ngc";

/// Reads by content and ending. `unit` is of lists whose columns do not say, and of clouds that state none. A kUsage Error for what is no
/// input of a conversion.
base::Result<Exchanged> read_exchanged(const std::filesystem::path& path, const std::string& unit);

/// The points of whatever has some, in mm; nothing of cameras and paths. `colmap_unit_mm` is the length of a COLMAP model's unit. A cloud
/// has them where its field `id` holds whole numbers; a kUsage Error where it has none.
base::Result<std::optional<FramedPoints>> points_of(const Exchanged& content, double colmap_unit_mm);

/// The same as a cloud, ids and sigmas as fields; a cloud stays what it is.
base::Result<std::optional<base::Cloud>> cloud_of(const Exchanged& content, double colmap_unit_mm);

/// The COLMAP model of whatever has one; nothing else.
std::optional<base::ColmapModel> colmap_of(const Exchanged& content);

/// The cameras of whatever has some; empty of the rest. Those of a COLMAP model are named by their numbers.
std::vector<PlacedCamera> cameras_of(const Exchanged& content);

/// The one with that name; without a name the only one. kUsage, with the names that there are.
base::Result<PlacedCamera> chosen_camera(const std::vector<PlacedCamera>& cameras, const std::string& name);

}  // namespace crosstie::app
