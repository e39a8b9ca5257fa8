#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/stitching.h"

namespace crosstie::base {

/// The body of a result of `stitch` (docs/formats.md).
nlohmann::ordered_json stitching_json(const Stitching& stitching);

}  // namespace crosstie::base
