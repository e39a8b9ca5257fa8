#pragma once

#include <filesystem>

#include "base/cloud.h"
#include "base/mesh.h"
#include "base/result.h"

namespace crosstie::base {

struct PlyOptions {
  bool double_coordinates = true;  ///< x y z as double; false: float, for viewers that read nothing else
};

/// Writes a binary little-endian PLY, atomically: x y z, nx ny nz, cov_xx cov_xy cov_xz cov_yy cov_yz cov_zz, and each field as
/// `scalar_<name>` (double where whole numbers need it), which CloudCompare shows; the first sigma, or else the first field, once more as
/// `quality`, which MeshLab shows. Comments state unit, frame and whose values `quality` repeats. kBadInput for a value that is too large for
/// its 4-byte float.
Result<> write_ply(const std::filesystem::path& path, const Cloud& cloud, const PlyOptions& options = {});

/// Reads ASCII and binary PLY of either endianness. The header's counts are checked against the file's size before anything is
/// allocated; values that are not finite are Errors. Elements other than `vertex` are skipped, and so is a `quality` that repeats a field.
Result<Cloud> read_ply(const std::filesystem::path& path);

/// The same with its element `face` (a list `vertex_indices` or `vertex_index` for each), polygons cut into triangles from their first
/// corner; a file without faces is a mesh without triangles. Indices out of range and faces of less than three corners are Errors;
/// triangles of no area are left out.
Result<Mesh> read_ply_mesh(const std::filesystem::path& path);

}  // namespace crosstie::base
