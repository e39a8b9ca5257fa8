#pragma once

#include <filesystem>
#include <vector>

#include "base/point_list.h"
#include "base/result.h"

namespace crosstie::base {

/// The markers of one station from the folder of its `scan`: middles of their dots in the rig's frame, with the covariance of the cameras'
/// noise alone (not the calibration's). Empty where the scan looked for none. Errors: kFileSystem; kBadInput with the file.
Result<std::vector<ReferencePoint>> read_scan_markers(const std::filesystem::path& folder);

}  // namespace crosstie::base
