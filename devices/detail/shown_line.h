#pragma once

#include <string>
#include <string_view>

namespace crosstie::devices::detail {

/// Received text for a message: its first 40 bytes, whatever is not printable ASCII as \xNN.
[[nodiscard]] std::string shown_line(std::string_view line);

}  // namespace crosstie::devices::detail
