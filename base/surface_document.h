#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/surface_verification.h"

namespace crosstie::base {

/// The keys `surface`, `shape` and `edge` of a verification, those that there are (docs/formats.md).
nlohmann::ordered_json surface_verification_json(const SurfaceVerification& verification);

}  // namespace crosstie::base
