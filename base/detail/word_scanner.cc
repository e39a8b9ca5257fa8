#include "base/detail/word_scanner.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "base/file.h"
#include "base/text.h"

namespace crosstie::base::detail {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::string_view kBlanks = " \t\r";
constexpr std::size_t kShownLetters = 40;

}  // namespace

WordScanner::WordScanner(const std::filesystem::path& path, std::string_view text) : path_(path), text_(text) {
  if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
}

bool WordScanner::next_line() {
  while (!failed() && !text_.empty()) {
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    rest_ = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    ++line_;
    if (!at_line_end() && !trim(rest_).starts_with('#')) return true;
  }
  return false;
}

bool WordScanner::at_line_end() const { return rest_.find_first_not_of(kBlanks) == std::string_view::npos; }

std::string_view WordScanner::word(const char* what) {
  const std::size_t begin = rest_.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    refuse(fmt::format("{} is missing", what));
    return {};
  }
  const std::size_t end = std::min(rest_.find_first_of(kBlanks, begin), rest_.size());
  const std::string_view found = rest_.substr(begin, end - begin);
  rest_.remove_prefix(end);
  return found;
}

double WordScanner::number(const char* what) {
  const std::string_view text = word(what);
  const auto value = parse_double(text);
  if (!value) refuse(fmt::format("\"{}\" is no {}", shown(std::string(text.substr(0, kShownLetters))), what));
  return failed() ? 0.0 : *value;
}

int WordScanner::integer(const char* what) {
  const std::string_view text = word(what);
  const auto value = parse_int(text);
  constexpr std::int64_t kLast = std::numeric_limits<int>::max();
  if (!value || *value < -kLast || *value > kLast) {
    refuse(fmt::format("\"{}\" is no {}", shown(std::string(text.substr(0, kShownLetters))), what));
  }
  return failed() ? 0 : static_cast<int>(*value);
}

int WordScanner::id(const char* what) {
  const int value = integer(what);
  if (value < 0) refuse(fmt::format("{} is no {}", value, what));
  return value;
}

std::optional<double> WordScanner::sigma(const char* what) {
  const std::size_t begin = std::min(rest_.find_first_not_of(kBlanks), rest_.size());
  if (rest_.substr(begin, rest_.find_first_of(kBlanks, begin) - begin) == "fix") {
    static_cast<void>(word(what));
    return std::nullopt;
  }
  const double value = number(what);
  if (value < 0.0) refuse(fmt::format("{} is negative", what));
  return value;
}

std::string WordScanner::quoted(const char* what) {
  const std::size_t begin = rest_.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos || rest_[begin] != '"') return std::string(word(what));
  const std::size_t end = rest_.find('"', begin + 1);
  if (end == std::string_view::npos) {
    refuse(fmt::format("the closing quotation mark of {} is missing", what));
    return {};
  }
  std::string found(rest_.substr(begin + 1, end - begin - 1));
  rest_.remove_prefix(end + 1);
  return found;
}

void WordScanner::expect_line_end() {
  if (!at_line_end()) refuse("more columns than expected");
}

void WordScanner::refuse(std::string reason) {
  if (!failed()) fault_ = std::move(reason);
}

tl::unexpected<Error> WordScanner::failure() const {
  return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path_), line_, fault_));
}

}  // namespace crosstie::base::detail
