#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace crosstie::base {

// Every source that includes toml++ defines TOML_ASSERT(expr) as nothing beforehand, all alike: in builds with assertions its parser ends
// the program for text that it refuses as an error in all others (a table's header that begins with no key, such as "[\x01]").

/// Parts that a dotted key may have (`a.b.c` has three). Default: far more than any of our files has, far fewer than what the parser's
/// recursion takes on a stack of 8 MB.
inline constexpr int kMaxTomlKeyParts = 32;

/// The first line, counted from 1, on which a TOML text has a key of more parts than that; nothing where there is none. To be asked before
/// a text from outside is parsed: toml++ limits how deep arrays and inline tables are nested, but not how deep the tables are that dotted
/// keys make, and a file of some megabytes ends the program by its stack.
[[nodiscard]] std::optional<int> too_deep_toml_line(std::string_view text);

/// A message on one line of bounded length, whatever it quotes: texts in TOML may hold line ends, and be as long as the file.
[[nodiscard]] std::string toml_message(std::string_view message);

}  // namespace crosstie::base
