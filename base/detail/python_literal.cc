#include "base/detail/python_literal.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::base::detail {
namespace {

constexpr int kMaxDepth = 16;

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  tl::expected<PythonLiteral, PythonError> parse() {
    PythonLiteral literal;
    if (!value(literal, 0)) return tl::unexpected<PythonError>(error());
    skip_blanks();
    if (!at_end()) {
      refuse("something follows the closing bracket");
      return tl::unexpected<PythonError>(error());
    }
    return literal;
  }

 private:
  [[nodiscard]] bool at_end() const { return at_ == text_.size(); }
  [[nodiscard]] char peek() const { return at_end() ? '\0' : text_[at_]; }

  bool refuse(std::string_view reason) {
    if (reason_.empty()) reason_ = reason;
    return false;
  }
  [[nodiscard]] PythonError error() const {
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(at_);
    return {static_cast<int>(std::count(text_.begin(), end, '\n')) + 1, reason_};
  }

  void skip_blanks() {
    while (!at_end()) {
      const char c = peek();
      if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (c == ' ' || c == '\t' || c == '\r' || c == '\n') {
        ++at_;
      } else {
        return;
      }
    }
  }

  /// True, and past it, where `c` comes next.
  bool take(char c) {
    skip_blanks();
    if (peek() != c || at_end()) return false;
    ++at_;
    return true;
  }

  bool value(PythonLiteral& out, int depth) {
    skip_blanks();
    if (at_end()) return refuse("the file is cut off");
    if (depth > kMaxDepth) return refuse("nested too deeply");
    if (take('{')) return dictionary(out, depth);
    if (take('[')) return list(out, ']', depth);
    if (take('(')) return list(out, ')', depth);
    if (peek() == '\'' || peek() == '"') return quoted(out, true);
    if (peek() == 'b' && at_ + 1 < text_.size() && (text_[at_ + 1] == '\'' || text_[at_ + 1] == '"')) {
      ++at_;
      return quoted(out, false);
    }
    return word(out);
  }

  bool dictionary(PythonLiteral& out, int depth) {
    out.kind = PythonLiteral::Kind::kDictionary;
    while (!take('}')) {
      PythonLiteral key;
      if (!value(key, depth + 1)) return false;
      if (key.kind != PythonLiteral::Kind::kText) return refuse("a key that is not a text");
      if (!take(':')) return refuse("a colon is missing");
      PythonLiteral entry;
      if (!value(entry, depth + 1)) return false;
      if (!out.entries.emplace(key.text, std::move(entry)).second)
        return refuse(fmt::format("the key {} occurs twice", key.text.substr(0, 80)));
      if (take(',')) continue;
      if (!take('}')) return refuse(at_end() ? "the file is cut off" : "a comma is missing");
      return true;
    }
    return true;
  }

  bool list(PythonLiteral& out, char closing, int depth) {
    out.kind = PythonLiteral::Kind::kList;
    while (!take(closing)) {
      PythonLiteral item;
      if (!value(item, depth + 1)) return false;
      out.items.push_back(std::move(item));
      if (take(',')) continue;
      if (!take(closing)) return refuse(at_end() ? "the file is cut off" : "a comma is missing");
      return true;
    }
    return true;
  }

  bool quoted(PythonLiteral& out, bool keep) {
    const char quote = peek();
    const std::size_t start = ++at_;
    for (; !at_end() && peek() != quote; ++at_) {
      if (peek() == '\n') return refuse("a quotation mark is not closed");
      if (peek() == '\\' && at_ + 1 < text_.size()) ++at_;
    }
    if (at_end()) return refuse("the file is cut off");
    out.kind = PythonLiteral::Kind::kText;
    if (keep) out.text = text_.substr(start, at_ - start);
    ++at_;
    return true;
  }

  bool word(PythonLiteral& out) {
    const std::size_t start = at_;
    at_ = std::min(text_.find_first_of(" \t\r\n,:]})#[({'\"", at_), text_.size());
    const std::string_view token = text_.substr(start, at_ - start);
    if (const auto number = parse_double(token)) {
      out.kind = PythonLiteral::Kind::kNumber;
      out.number = *number;
      return true;
    }
    out.kind = PythonLiteral::Kind::kName;
    out.text = token;
    if (token == "None" || token == "True" || token == "False") return true;
    at_ = start;
    return refuse(fmt::format("\"{}\" is no finite number", token.substr(0, 40)));
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::string reason_;
};

}  // namespace

const PythonLiteral* PythonLiteral::find(const std::string& key) const {
  const auto found = entries.find(key);
  return found == entries.end() ? nullptr : &found->second;
}

tl::expected<PythonLiteral, PythonError> parse_python_literal(std::string_view text) { return Parser(text).parse(); }

}  // namespace crosstie::base::detail
