#include "base/detail/table_scanner.h"

#include "base/text.h"

namespace crosstie::base::detail {

TableScanner::Found<bool> TableScanner::begin() {
  if (text_.starts_with("\xEF\xBB\xBF")) position_ = 3;
  if (text_.find('\0') != std::string_view::npos) {
    return tl::unexpected<std::string>("the file is not UTF-8 text");
  }
  while (!at_end() && skip_rest_if_empty()) {
    if (at_end()) break;
    ++position_;
    ++line_;
  }
  bool comma = false, semicolon = false, tab = false, quoted = false;
  for (std::size_t i = position_; i < text_.size() && text_[i] != '\n' && (quoted || text_[i] != '#'); ++i) {
    if (text_[i] == '"') quoted = !quoted;
    if (quoted) continue;
    comma |= text_[i] == ',';
    semicolon |= text_[i] == ';';
    tab |= text_[i] == '\t';
  }
  if (comma && semicolon) return tl::unexpected<std::string>("the header holds commas and semicolons: which one separates?");
  by_blanks_ = !comma && !semicolon && !tab;
  separator_ = comma ? ',' : semicolon ? ';' : '\t';
  return true;
}

TableScanner::Found<bool> TableScanner::next(std::vector<std::string>& cells, std::size_t max_cells) {
  cells.clear();
  while (!at_end() && skip_rest_if_empty()) {
    if (at_end()) break;
    ++position_;
    ++line_;
  }
  if (at_end()) return false;
  row_line_ = line_;
  for (;;) {
    auto next_cell = cell();
    if (!next_cell) return tl::unexpected<std::string>(std::move(next_cell).error());
    if (cells.size() <= max_cells) cells.push_back(*std::move(next_cell));
    skip_blanks();
    if (!at_end() && text_[position_] == '#') skip_comment();
    if (at_end()) return true;
    if (text_[position_] == '\n') {
      ++position_;
      ++line_;
      return true;
    }
    if (by_blanks_) continue;
    if (text_[position_] != separator_) return tl::unexpected<std::string>("text follows a closing quotation mark");
    ++position_;
  }
}

void TableScanner::skip_blanks() {
  while (!at_end()) {
    const char c = text_[position_];
    const bool blank = c == ' ' || c == '\r' || (c == '\t' && (by_blanks_ || separator_ != '\t'));
    if (!blank) return;
    ++position_;
  }
}

void TableScanner::skip_comment() {
  while (!at_end() && text_[position_] != '\n') ++position_;
}

bool TableScanner::skip_rest_if_empty() {
  std::size_t i = position_;
  while (i < text_.size() && (text_[i] == ' ' || text_[i] == '\t' || text_[i] == '\r')) ++i;
  if (i < text_.size() && text_[i] != '\n' && text_[i] != '#') return false;
  position_ = i;
  skip_comment();
  return true;
}

TableScanner::Found<std::string> TableScanner::cell() {
  skip_blanks();
  if (!at_end() && text_[position_] == '"') return quoted_cell();
  const std::size_t start = position_;
  while (!at_end() && text_[position_] != '\n' && text_[position_] != '#' && !is_separator(text_[position_])) {
    if (text_[position_] == '"') return tl::unexpected<std::string>("a quotation mark in the middle of a cell");
    ++position_;
  }
  return std::string(trim(text_.substr(start, position_ - start)));
}

TableScanner::Found<std::string> TableScanner::quoted_cell() {
  std::string result;
  for (++position_; !at_end(); ++position_) {
    const char c = text_[position_];
    if (c != '"') {
      if (c == '\n') ++line_;
      result += c;
    } else if (position_ + 1 < text_.size() && text_[position_ + 1] == '"') {
      result += c;
      ++position_;
    } else {
      ++position_;
      return result;
    }
  }
  line_ = row_line_;
  return tl::unexpected<std::string>("a quotation mark is not closed");
}

}  // namespace crosstie::base::detail
