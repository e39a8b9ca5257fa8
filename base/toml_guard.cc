#include "base/toml_guard.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::base {
namespace {

constexpr std::size_t kLongestMessage = 600;

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 0x80; }

/// Reads over a text as the parser does. Where that would give up, what comes then does not matter.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // the mark of UTF-8
  }

  std::optional<TomlFault> fault() {
    while (at_ < text_.size() && what_.empty()) {
      const char c = text_[at_];
      if (c == '"' || c == '\'') {
        skip_quoted(c);
      } else if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else {
        take(c);
      }
    }
    if (what_.empty()) return std::nullopt;
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size()));
    return TomlFault{static_cast<int>(std::count(text_.begin(), end, '\n')) + 1, what_};
  }

 private:
  void take(char c) {
    constexpr std::string_view kEndsOfKeys = "\n=,[]{}";
    if (!is_ascii(c)) {
      what_ = "a character that is not ASCII stands outside of quotes";
    } else if (c == '.' && ++parts_ > kMaxTomlKeyParts) {
      what_ = fmt::format("a key of more than {} parts", kMaxTomlKeyParts);
    } else {
      if (kEndsOfKeys.find(c) != std::string_view::npos) parts_ = 1;
      ++at_;
    }
  }

  [[nodiscard]] bool three_at(std::size_t at, char quote) const { return text_.substr(at, 3) == std::string(3, quote); }

  /// Basic or literal, of one line or several; an unclosed one of one line ends with it.
  void skip_quoted(char quote) {
    const bool several = three_at(at_, quote);
    for (at_ += several ? 3 : 1; at_ < text_.size() && what_.empty(); ++at_) {
      if (quote == '"' && text_[at_] == '\\') {
        skip_escape(several);
      } else if (several ? three_at(at_, quote) : text_[at_] == quote) {
        at_ += several ? 3 : 1;
        for (int more = 0; several && more < 2 && at_ < text_.size() && text_[at_] == quote; ++more)
          ++at_;  // belong to the text
        return;
      } else if (!several && text_[at_] == '\n') {
        return;
      }
    }
  }

  /// To the last character of what belongs to a backslash.
  void skip_escape(bool several) {
    std::size_t next = at_ + 1;
    if (several) next = std::min(text_.find_first_not_of(" \t\r\n", next), text_.size());
    if (several && next < text_.size() && !is_ascii(text_[next])) {
      at_ = next;
      what_ = "a character that is not ASCII follows a backslash";
    } else {
      at_ = next == at_ + 1 ? next : next - 1;
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int parts_ = 1;
  std::string what_;
};

}  // namespace

std::optional<TomlFault> toml_fault(std::string_view text) { return Scanner(text).fault(); }

std::string toml_message(std::string_view message) {
  if (message.size() <= kLongestMessage) return shown(std::string(message));
  std::size_t end = kLongestMessage;
  while (end > 0 && (static_cast<unsigned char>(message[end]) & 0xC0U) == 0x80U) --end;  // not within a character of UTF-8
  return shown(std::string(message.substr(0, end))) + "...";
}

}  // namespace crosstie::base
