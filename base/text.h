#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace crosstie::base {

/// Numbers are read and written in the C locale whatever the process's locale is.

/// The whole of `text` (blanks at its ends aside) as a finite number; nothing where anything else stands there.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_int(std::string_view text);

/// The shortest decimal that reads back as exactly `value` ("0.1", "1e-07"); "nan", "inf", "-inf" where it is not finite.
std::string format_double(double value);

std::string_view trim(std::string_view text);
std::vector<std::string_view> split(std::string_view text, char separator);

/// The candidate nearest to `word` in edit distance, where it is near enough to be meant: for "did you mean".
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace crosstie::base
