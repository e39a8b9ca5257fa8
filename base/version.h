#pragma once

#include <string_view>

namespace crosstie::base {

/// The software's version, "0.1.0".
[[nodiscard]] std::string_view version();

}  // namespace crosstie::base
