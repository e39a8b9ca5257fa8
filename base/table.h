#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace crosstie::base {

/// A delimited text table with named columns, as text. Every cell remembers its line for error messages.
struct Table {
  std::filesystem::path path;  ///< where it was read from
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  std::vector<int> lines;  ///< line number of each row, from 1

  [[nodiscard]] std::optional<std::size_t> column(std::string_view name) const;
  /// An Error that names file and line where the cell is not a finite number (not an integer).
  [[nodiscard]] Result<double> number(std::size_t row, std::size_t column) const;
  [[nodiscard]] Result<int> integer(std::size_t row, std::size_t column) const;
};

/// Reads a table whose first line names the columns. The separator is found from that line: comma, semicolon, tab or blanks.
/// Accepts a byte-order mark, CRLF, a missing last newline and quoted cells; `#` starts a comment. Rows whose number of cells
/// differs from the header's are Errors with their line.
Result<Table> read_table(const std::filesystem::path& path);
/// The same for a text in memory; `path` is what error messages name.
Result<Table> parse_table(const std::filesystem::path& path, std::string_view contents);

/// Comma-separated, quoted where needed, LF, written atomically. Numbers go in as format_double() makes them.
Result<> write_table(const std::filesystem::path& path, const Table& table);

}  // namespace crosstie::base
