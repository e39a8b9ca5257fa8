#pragma once

#include <filesystem>

#include "base/cloud.h"
#include "base/result.h"

namespace crosstie::base {

/// Writes a binary PCD file of version 0.7, atomically: x y z, normal_x normal_y normal_z, cov_xx ... cov_zz and each field under its
/// own name, all 4-byte floats as the Point Cloud Library reads them (near 1 m: to 1e-4 mm); comments state unit and frame. kBadInput for a value
/// that is too large for a float.
Result<> write_pcd(const std::filesystem::path& path, const Cloud& cloud);

/// Reads PCD files of the Point Cloud Library: ascii, binary and binary_compressed, numbers of all types. The header's counts are checked
/// against the file's size before anything is allocated. Points whose coordinates are NaN (holes of an organised cloud) are left out;
/// colours, padding and fields of several numbers are read over; other values that are not finite are Errors, as is a comment
/// that names another unit than mm.
Result<Cloud> read_pcd(const std::filesystem::path& path);

}  // namespace crosstie::base
