#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "base/camera.h"
#include "base/colmap_model.h"
#include "base/network.h"
#include "base/point_list.h"
#include "base/result.h"

namespace crosstie::app {

/// A list of points with the frame it is in, where that is known.
struct FramedPoints {
  std::string frame;
  base::PointList list;
};

/// What a file or folder of the exchange holds.
using Exchanged = std::variant<FramedPoints, base::Camera, base::AdjustedNetwork, base::ColmapModel>;

/// What is possible, for messages and for the help.
inline constexpr const char* kConversions =
    "list of points (.csv, .txt, .obc) -> .csv .obc .ply; camera (.cameramodel, .yaml, .yml; also kalibr's chain) -> "
    ".cameramodel .yaml .yml; "
    "result "
    "of adjust (folder or result.json) -> .csv .obc .ply or a COLMAP folder; COLMAP folder -> .csv .obc .ply or a COLMAP "
    "folder";

/// Reads by content and ending; `camera` chooses in a chain of cameras. A kUsage Error for what is no input of a conversion.
base::Result<Exchanged> read_exchanged(const std::filesystem::path& path, const std::string& unit,
                                       const std::string& camera = {});

/// The points of whatever has some, in mm; nothing of cameras. `colmap_unit_mm` is the length of a COLMAP model's unit.
base::Result<std::optional<FramedPoints>> points_of(const Exchanged& content, double colmap_unit_mm);

/// The COLMAP model of whatever has one; nothing else.
std::optional<base::ColmapModel> colmap_of(const Exchanged& content);

/// By the ending: .csv, .obc or .ply.
base::Result<> write_points(const std::filesystem::path& path, const FramedPoints& points);

}  // namespace crosstie::app
