#pragma once

#include <filesystem>
#include <string>

#include "app/job.h"
#include "base/result.h"
#include "base/tool_path.h"
#include "edge/tool_path.h"

namespace crosstie::app {

/// What [path] says, for edge::tool_path(). The reach counts in machine only.
[[nodiscard]] edge::ToolPathOptions path_options(const JobPath& path, const std::string& frame);

/// Writes path.json, path.csv, path.dxf and path.ngc into a folder (of a result in the making: all of them or none is published).
/// `template_file` as JobPath has it, resolved; empty: the program's own. Errors: those of reading it and of gcode_of(), with its name.
base::Result<> write_path_files(const std::filesystem::path& folder, const base::ToolPath& tool_path, const JobPath& path,
                                const std::filesystem::path& template_file, const std::string& program);

}  // namespace crosstie::app
