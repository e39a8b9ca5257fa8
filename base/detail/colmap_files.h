#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/colmap_model.h"
#include "base/result.h"

namespace crosstie::base::detail {

/// The names of a model's files without their ending, in the order in which they are read and written here.
inline constexpr std::array<std::string_view, 3> kColmapFiles = {"cameras", "images", "points3D"};

/// Contents of the files in the order of kColmapFiles.
using ColmapContents = std::array<std::string, kColmapFiles.size()>;
using ColmapPaths = std::array<std::filesystem::path, kColmapFiles.size()>;

/// Lists in the files' order and not yet checked against each other; `paths` are what error messages name.
Result<ColmapModel> parse_colmap_text(const ColmapPaths& paths, const ColmapContents& contents);
Result<ColmapModel> parse_colmap_binary(const ColmapPaths& paths, const ColmapContents& contents);

/// The model is consistent and its lens models have counterparts.
ColmapContents format_colmap_text(const ColmapModel& model);
ColmapContents format_colmap_binary(const ColmapModel& model);

/// A quaternion (w, x, y, z) as it stands in a file; false where it is none of a rotation. One that is of unit length to the
/// last digits is kept as it is, so that files read back as they were written.
bool rotation_of_colmap(const std::array<double, 4>& wxyz, Eigen::Quaterniond& rotation);

}  // namespace crosstie::base::detail
