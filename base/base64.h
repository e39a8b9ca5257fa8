#pragma once

#include <string>
#include <string_view>

namespace crosstie::base {

/// Bytes as text of letters, digits, + and /, filled up with = (RFC 4648, section 4).
std::string base64(std::string_view bytes);

}  // namespace crosstie::base
