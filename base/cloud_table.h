#pragma once

#include <filesystem>

#include "base/cloud.h"
#include "base/result.h"

namespace crosstie::base {

/// Writes a cloud as a table with named columns, atomically and exact to the last digit: id (where a field of that name holds whole numbers),
/// x_mm y_mm z_mm, nx ny nz, cov_xx_mm2 ... cov_zz_mm2 and each field under its name. With ids it is a list of points
/// (base/point_list.h), without the field sigma_mm where there are covariances. Separated by commas, or by blanks where `path` ends in .txt.
Result<> write_cloud_table(const std::filesystem::path& path, const Cloud& cloud);

}  // namespace crosstie::base
