#pragma once

#include <string_view>

namespace crosstie::live::detail {

/// Whether two tokens are equal, in a time that depends on their lengths only.
[[nodiscard]] bool same_token(std::string_view given, std::string_view wanted);

/// 16 to 128 letters, digits, - or _: fit for a header and for the fragment of a URL.
[[nodiscard]] bool valid_token(std::string_view token);

}  // namespace crosstie::live::detail
