#include "base/toml_guard.h"

#include <algorithm>

#include "base/file.h"

namespace crosstie::base {
namespace {

constexpr std::size_t kLongestMessage = 600;

/// Past the text in quotes that begins at `at`: basic or literal, of one line or several. An unclosed one ends with the line, or with all.
std::size_t after_quotes(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const std::string several(3, quote);
  const bool is_several = text.substr(at).starts_with(several);
  for (at += is_several ? 3 : 1; at < text.size(); ++at) {
    if (quote == '"' && text[at] == '\\') {
      ++at;
    } else if (is_several ? text.substr(at).starts_with(several) : text[at] == quote) {
      return at + (is_several ? 3 : 1);
    } else if (!is_several && text[at] == '\n') {
      return at;
    }
  }
  return text.size();
}

}  // namespace

std::optional<int> too_deep_toml_line(std::string_view text) {
  constexpr std::string_view kEndsOfKeys = "\n=,[]{}";
  int line = 1;
  int parts = 1;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '"' || c == '\'') {
      const std::size_t end = after_quotes(text, at);
      line += static_cast<int>(std::count(text.begin() + static_cast<std::ptrdiff_t>(at), text.begin() + static_cast<std::ptrdiff_t>(end), '\n'));
      at = end;
      continue;
    }
    if (c == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (c == '.' && ++parts > kMaxTomlKeyParts) return line;
    if (kEndsOfKeys.find(c) != std::string_view::npos) parts = 1;
    if (c == '\n') ++line;
    ++at;
  }
  return std::nullopt;
}

std::string toml_message(std::string_view message) {
  if (message.size() <= kLongestMessage) return shown(std::string(message));
  std::size_t end = kLongestMessage;
  while (end > 0 && (static_cast<unsigned char>(message[end]) & 0xC0U) == 0x80U) --end;  // not within a character of UTF-8
  return shown(std::string(message.substr(0, end))) + "...";
}

}  // namespace crosstie::base
