#include "base/table.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "base/detail/table_scanner.h"
#include "base/file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

constexpr std::size_t kMaxTableBytes = std::size_t{256} << 20;
constexpr std::size_t kMaxColumns = 1000;
constexpr std::size_t kMaxNameLength = 200;

/// A cell as an error message shows it.
std::string excerpt(std::string_view cell) {
  constexpr std::size_t kLongest = 40;
  std::string result(cell.substr(0, kLongest));
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return cell.size() > kLongest ? result + "..." : result;
}

tl::unexpected<Error> bad_cell(const Table& table, std::size_t row, std::size_t column, std::string_view wanted) {
  const std::string& cell = table.rows[row][column];
  const bool comma = cell.find(',') != std::string::npos;
  return fail(ErrorCode::kBadInput,
              fmt::format("{}:{}: {} reads \"{}\", which is not {}{}", shown(table.path), table.lines[row],
                          table.columns[column], excerpt(cell), wanted, comma ? "; the decimal sign is the point" : ""));
}

Result<> check_columns(const Table& table, int line) {
  const auto error = [&](std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(table.path), line, what));
  };
  if (table.columns.size() > kMaxColumns) return error(fmt::format("more than {} columns", kMaxColumns));
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const std::string& name = table.columns[i];
    if (name.empty()) return error(fmt::format("column {} has no name", i + 1));
    if (name.size() > kMaxNameLength) return error(fmt::format("column {} has a name of {} bytes", i + 1, name.size()));
    if (parse_double(name)) {
      return error(fmt::format("the first line must name the columns, but reads \"{}\" in column {}", excerpt(name), i + 1));
    }
    if (std::count(table.columns.begin(), table.columns.end(), name) > 1) {
      return error(fmt::format("two columns are named \"{}\"", excerpt(name)));
    }
  }
  return {};
}

std::string quoted(const std::string& cell) {
  const bool plain =
      !cell.empty() && cell.find_first_of(",;\t\r\n\"#") == std::string::npos && trim(cell).size() == cell.size();
  if (plain) return cell;
  std::string result = "\"";
  for (const char c : cell) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

void append_row(std::string& text, const std::vector<std::string>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) text += ',';
    text += quoted(cells[i]);
  }
  text += '\n';
}

}  // namespace

std::optional<std::size_t> Table::column(std::string_view name) const {
  const auto found = std::find(columns.begin(), columns.end(), name);
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

Result<double> Table::number(std::size_t row, std::size_t column) const {
  const auto value = parse_double(rows[row][column]);
  if (!value) return bad_cell(*this, row, column, "a finite number");
  return *value;
}

Result<int> Table::integer(std::size_t row, std::size_t column) const {
  const auto value = parse_int(rows[row][column]);
  if (!value || *value < std::numeric_limits<int>::min() || *value > std::numeric_limits<int>::max()) {
    return bad_cell(*this, row, column, "an integer");
  }
  return static_cast<int>(*value);
}

Result<Table> read_table(const std::filesystem::path& path) {
  auto contents = read_file(path, kMaxTableBytes);
  if (!contents) return fail(std::move(contents));
  return parse_table(path, *contents);
}

Result<Table> parse_table(const std::filesystem::path& path, std::string_view contents) {
  detail::TableScanner scanner(contents);
  const auto error = [&](int line, std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), line, what));
  };
  if (auto usable = scanner.begin(); !usable) return error(scanner.line(), usable.error());

  Table table;
  table.path = path;
  for (;;) {
    std::vector<std::string> cells;
    const auto found = scanner.next(cells, table.columns.empty() ? kMaxColumns : table.columns.size());
    if (!found) return error(scanner.line(), found.error());
    if (!*found) break;
    const int line = scanner.row_line();
    if (table.columns.empty()) {
      table.columns = std::move(cells);
      if (auto good = check_columns(table, line); !good) return fail(std::move(good));
      continue;
    }
    if (cells.size() != table.columns.size()) {
      return error(line, fmt::format("{} cells, but the header names {} columns",
                                     cells.size() > table.columns.size() ? "too many" : std::to_string(cells.size()),
                                     table.columns.size()));
    }
    table.rows.push_back(std::move(cells));
    table.lines.push_back(line);
  }
  if (table.columns.empty()) return error(1, "the table is empty: a first line that names the columns is expected");
  return table;
}

Result<> write_table(const std::filesystem::path& path, const Table& table) {
  std::string text;
  append_row(text, table.columns);
  for (const auto& row : table.rows) append_row(text, row);
  return write_file_atomically(path, text);
}

}  // namespace crosstie::base
