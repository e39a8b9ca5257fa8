#pragma once

#include <filesystem>
#include <span>

#include "base/result.h"

namespace crosstie::base {

/// Writes a TIFF with one 32-bit float a pixel, uncompressed, row by row, atomically: depths in mm, not a number where there is none.
/// `values` has width * height of them. Error kFileSystem where the file cannot be written, kBadInput where it would exceed 4 GiB.
Result<> write_depth_tiff(const std::filesystem::path& path, int width, int height, std::span<const float> values);

}  // namespace crosstie::base
