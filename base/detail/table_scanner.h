#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

namespace crosstie::base::detail {

/// Cuts the text of a delimited table into rows of cells; keeps count of the lines.
class TableScanner {
 public:
  template <typename T>
  using Found = tl::expected<T, std::string>;  ///< the error says what is wrong at line()

  explicit TableScanner(std::string_view text) : text_(text) {}

  /// Skips a byte-order mark and finds the separator from the first line that holds anything.
  Found<bool> begin();

  /// Fills the cells of the next row; false at the end. Cells beyond `max_cells` + 1 are an error-worthy surplus and are cut
  /// off.
  Found<bool> next(std::vector<std::string>& cells, std::size_t max_cells);

  [[nodiscard]] int line() const { return line_; }
  /// The line in which the row that next() returned began.
  [[nodiscard]] int row_line() const { return row_line_; }

 private:
  [[nodiscard]] bool at_end() const { return position_ == text_.size(); }
  [[nodiscard]] bool is_separator(char c) const { return by_blanks_ ? c == ' ' || c == '\t' : c == separator_; }
  void skip_blanks();
  void skip_comment();
  /// True where the current line holds nothing more than blanks and a comment, which are then skipped.
  bool skip_rest_if_empty();
  Found<std::string> cell();
  Found<std::string> quoted_cell();

  std::string_view text_;
  std::size_t position_ = 0;
  int line_ = 1;
  int row_line_ = 1;
  bool by_blanks_ = false;
  char separator_ = ',';
};

}  // namespace crosstie::base::detail
