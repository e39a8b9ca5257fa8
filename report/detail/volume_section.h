#pragma once

#include <string>
#include <vector>

#include "report/commissioning_report.h"

namespace crosstie::report::detail {

/// U by the frame over the working volume; finished markup.
std::string volume_section(const std::vector<VolumeMap>& volume);

}  // namespace crosstie::report::detail
