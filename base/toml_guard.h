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

struct TomlFault {
  int line = 1;  ///< counted from 1
  std::string what;
};

/// The first thing in a text that toml++ 3.3 must not be given; to be asked before a text from outside is parsed:
///   - a key of more than kMaxTomlKeyParts parts: the parser limits how deep arrays and inline tables are nested, but not how deep the tables
///     are that dotted keys make, and a file of some megabytes ends the program by its stack;
///   - a character that is not ASCII outside of quotes and comments, where TOML has none, or as the first one after a backslash that joins lines:
///     what the parser asks of it ends in undefined behaviour.
[[nodiscard]] std::optional<TomlFault> toml_fault(std::string_view text);

/// A message on one line of bounded length, whatever it quotes: texts in TOML may hold line ends, and be as long as the file.
[[nodiscard]] std::string toml_message(std::string_view message);

}  // namespace crosstie::base
