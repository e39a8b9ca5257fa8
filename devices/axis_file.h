#pragma once

#include <filesystem>
#include <memory>

#include "base/result.h"
#include "devices/axis_line.h"
#include "devices/axis_reader.h"

namespace crosstie::devices {

struct AxisFileOptions {
  std::filesystem::path path;  ///< need not exist yet
  AxisLineFormat line = {};
};

/// The last line of a text file that the control or a script appends to or rewrites.
///
/// Only a line that is closed by its line end counts: `85` may be the begin of `850.04`. While the file is empty, missing, half
/// written or damaged, the reading before stays with its own time. A reading's time is that of the file's last change, so a file
/// that nobody wrote since yesterday is stale from the first look. The file's end alone is read, however long it is.
///
/// Errors: kUsage for a format out of its domain.
base::Result<std::unique_ptr<AxisReader>> read_axis_file(AxisFileOptions options, Clock clock = host_now);

}  // namespace crosstie::devices
