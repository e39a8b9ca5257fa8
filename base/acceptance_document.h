#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/acceptance.h"
#include "base/repeatability.h"

namespace crosstie::base {

/// The key `acceptance` of a verification (docs/formats.md); the points' deviations stand in deviations.csv.
nlohmann::ordered_json acceptance_json(const Acceptance& acceptance);
/// The key `repeatability` of a verification.
nlohmann::ordered_json repeatability_json(const Repeatability& repeatability);

}  // namespace crosstie::base
