#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace crosstie::report::detail {

/// `text` for element contents and quoted attributes: & < > " ' become references; control characters, which no XML parser
/// accepts, and bytes that are no UTF-8 become the replacement character.
std::string escape(std::string_view text);

/// A string inside a JSON text inside a script element: quoted, with < > & as \u escapes.
std::string json_quoted(std::string_view text);

/// One cell: what is read, and by what it is sorted where that is a number.
struct Cell {
  std::string text;       ///< plain text
  std::string sort_key;   ///< empty: sorted by its text
  std::string css_class;  ///< "ok", "warning", "fail", "muted", ...
  std::string href;       ///< "#p-11": makes the text a link
};

/// A cell with a number in it, sorted by its exact value.
Cell number_cell(std::string text, double value, std::string css_class = "");
Cell text_cell(std::string text, std::string css_class = "");

struct Column {
  std::string name;
  std::string unit = {};   ///< shown below the name
  std::string about = {};  ///< what it means, as a tooltip
  bool numeric = true;
};

/// A table with a caption, whose columns sort on a click where the page's script runs. The first column names the row.
class HtmlTable {
 public:
  HtmlTable(std::string caption, std::vector<Column> columns);

  /// `row_id` becomes the anchor of the row; empty for none.
  void add_row(std::vector<Cell> cells, const std::string& row_id = "");
  /// On narrow screens each row becomes a card, with the columns' names beside what stands in them. Before the first row.
  void as_cards() { cards_ = true; }
  /// Rows beyond `max_rows` are not shown; the table then says how many there are and where they stand.
  void limit_rows(std::size_t max_rows, std::string where_all_are);
  [[nodiscard]] std::string html() const;
  [[nodiscard]] bool empty() const { return rows_.empty(); }

 private:
  std::string caption_;
  std::vector<Column> columns_;
  std::vector<std::string> rows_;
  std::size_t max_rows_ = 0;
  bool cards_ = false;
  std::string where_all_are_;
};

/// Pairs of term and value.
std::string definition_list(const std::vector<std::pair<std::string, std::string>>& entries);

/// A figure with a caption round finished SVG; `wide` takes the whole width.
std::string figure(const std::string& svg, std::string_view caption, bool wide = false);
/// Figures side by side as far as the page is wide.
std::string figures(const std::vector<std::string>& list);

/// An anchor from any string: "p-" and what is safe in a URL.
std::string anchor(std::string_view prefix, std::string_view name);

}  // namespace crosstie::report::detail
