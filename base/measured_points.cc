#include "base/measured_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "base/file.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kHeaderBytes = 4096;  // of a PLY file in which its unit is looked for
constexpr std::size_t kMaxCells = 64;       // of a line of numbers
constexpr double kLargest_mm = 1e12;

std::optional<double> unit_in_mm(std::string_view unit) {
  if (unit == "mm") return 1.0;
  if (unit == "m") return 1000.0;
  if (unit == "inch") return 25.4;
  return std::nullopt;
}

tl::unexpected<Error> bad(const fs::path& path, int line, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), line, what));
}

tl::unexpected<Error> no_unit(const fs::path& path) {
  return fail(ErrorCode::kUsage, fmt::format("{} does not say its unit; state it: mm, m or inch", shown(path)));
}

/// The next line of `text` without comment and blanks at its ends; advances `text` and `line`.
std::string_view next_line(std::string_view& text, int& line) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view content = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  ++line;
  return trim(content.substr(0, content.find('#')));
}

/// The cells of a line of numbers, at most kMaxCells + 1.
void cells_of(std::string_view line, std::vector<std::string_view>& cells) {
  constexpr std::string_view kBlanks = " \t\r";
  constexpr std::string_view kSeparators = " \t\r,;";
  cells.clear();
  while (!line.empty() && cells.size() <= kMaxCells) {
    const std::size_t end = std::min(line.find_first_of(kSeparators), line.size());
    cells.push_back(line.substr(0, end));
    line.remove_prefix(end);
    // One comma or semicolon with blanks about it, or blanks alone.
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty() || (line.front() != ',' && line.front() != ';')) continue;
    line.remove_prefix(1);
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty()) cells.emplace_back();
  }
}

/// Whether the first line that holds anything holds numbers only.
bool has_no_header(std::string_view text) {
  int line = 0;
  std::vector<std::string_view> cells;
  while (!text.empty()) {
    const std::string_view content = next_line(text, line);
    if (content.empty()) continue;
    cells_of(content, cells);
    return std::all_of(cells.begin(), cells.end(), [](std::string_view cell) { return parse_double(cell).has_value(); });
  }
  return false;
}

/// Which cells of a line are x, y, z.
Result<std::array<std::size_t, 3>> cells_by_number(const fs::path& path, const std::vector<std::string>& columns) {
  std::array<std::size_t, 3> places = {0, 1, 2};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto number = parse_int(columns[i]);
    if (!number || *number < 1 || *number > static_cast<std::int64_t>(kMaxCells)) {
      return fail(ErrorCode::kUsage,
                  fmt::format("{} has no header: its columns are called 1, 2, 3, ..., not '{}'", shown(path), columns[i]));
    }
    places[i] = static_cast<std::size_t>(*number - 1);
  }
  return places;
}

Result<MeasuredPoints> read_numbers(const fs::path& path, std::string_view text, const MeasuredPointsOptions& options) {
  const auto places = cells_by_number(path, options.columns);
  if (!places) return tl::unexpected(places.error());
  const auto unit_mm = unit_in_mm(options.unit);
  if (!unit_mm) return no_unit(path);
  MeasuredPoints measured;
  std::vector<std::string_view> cells;
  std::optional<std::int64_t> stated;
  std::size_t width = 0;
  int line = 0;
  while (!text.empty()) {
    const std::string_view content = next_line(text, line);
    if (content.empty()) continue;
    cells_of(content, cells);
    if (cells.size() == 1 && !stated && measured.points_mm.empty()) {
      stated = parse_int(cells[0]);
      if (!stated || *stated < 0) return bad(path, line, "a first line with one number is the count of points");
      continue;
    }
    if (cells.size() < 3) return bad(path, line, "three coordinates are expected");
    if (cells.size() > kMaxCells) return bad(path, line, fmt::format("more than {} columns", kMaxCells));
    if (width == 0) width = cells.size();
    if (cells.size() != width) {
      return bad(path, line, fmt::format("{} columns, but {} in the lines before", cells.size(), width));
    }
    Eigen::Vector3d point;
    for (std::size_t i = 0; i < 3; ++i) {
      if ((*places)[i] >= width) return bad(path, line, fmt::format("there is no column {}", (*places)[i] + 1));
      const auto value = parse_double(cells[(*places)[i]]);
      if (!value) return bad(path, line, fmt::format("'{}' is not a finite number", cells[(*places)[i]].substr(0, 40)));
      point(static_cast<Eigen::Index>(i)) = *value * *unit_mm;
    }
    if (!(point.cwiseAbs().maxCoeff() <= kLargest_mm)) return bad(path, line, "a coordinate is too large");
    measured.points_mm.push_back(point);
  }
  if (stated && *stated != static_cast<std::int64_t>(measured.points_mm.size())) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: {} points are announced, {} are there", shown(path), *stated, measured.points_mm.size()));
  }
  if (measured.points_mm.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: holds no points", shown(path)));
  return measured;
}

/// The unit at the end of a column's name: x_mm.
std::string unit_of_name(const std::string& name) {
  const std::string ending = name.substr(std::min(name.rfind('_'), name.size()));
  return ending.size() > 1 && unit_in_mm(ending.substr(1)) ? ending.substr(1) : "";
}

Result<MeasuredPoints> read_columns(const fs::path& path, std::string_view text, const MeasuredPointsOptions& options) {
  const auto table = parse_table(path, text);
  if (!table) return tl::unexpected(table.error());
  std::vector<std::string> names = options.columns;
  for (const char* ending : {"_mm", "_m", "_inch", ""}) {
    if (names.empty() && table->column(std::string("x") + ending)) {
      for (const char* axis : {"x", "y", "z"}) names.push_back(std::string(axis) + ending);
    }
  }
  if (names.empty()) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("{}: no columns x_mm, y_mm, z_mm (or x, y, z); name the three that hold the coordinates", shown(path)));
  }
  std::array<std::size_t, 3> places{};
  std::string unit = options.unit;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto place = table->column(names[i]);
    if (!place) return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing", shown(path), names[i]));
    places[i] = *place;
    const std::string said = unit_of_name(names[i]);
    if (said.empty()) continue;
    if (!unit.empty() && unit != said) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}: its column {} is in {}, but {} was stated", shown(path), names[i], said, unit));
    }
    unit = said;
  }
  const auto unit_mm = unit_in_mm(unit);
  if (!unit_mm) return no_unit(path);
  MeasuredPoints measured;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    Eigen::Vector3d point;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto value = table->number(row, places[i]);
      if (!value) return tl::unexpected(value.error());
      point(static_cast<Eigen::Index>(i)) = *value * *unit_mm;
    }
    if (!(point.cwiseAbs().maxCoeff() <= kLargest_mm)) return bad(path, table->lines[row], "a coordinate is too large");
    measured.points_mm.push_back(point);
  }
  if (measured.points_mm.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: holds no points", shown(path)));
  return measured;
}

Result<MeasuredPoints> read_list(const fs::path& path, const MeasuredPointsOptions& options) {
  const auto list = read_point_list(path, {options.unit});
  if (!list) return tl::unexpected(list.error());
  MeasuredPoints measured;
  for (const ReferencePoint& point : list->points) {
    measured.points_mm.push_back(point.xyz_mm);
    if (point.cov_mm2) measured.cov_mm2.push_back(*point.cov_mm2);
  }
  if (measured.cov_mm2.size() != measured.points_mm.size()) measured.cov_mm2.clear();
  if (measured.points_mm.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: holds no points", shown(path)));
  return measured;
}

Result<MeasuredPoints> read_cloud(const fs::path& path, std::string_view contents, const MeasuredPointsOptions& options) {
  if (!options.columns.empty()) {
    return fail(ErrorCode::kUsage,
                fmt::format("{}: the coordinates of a PLY file are x, y, z; no columns can be chosen", shown(path)));
  }
  const std::string_view header = contents.substr(0, std::min(contents.find("end_header"), kHeaderBytes));
  const bool says_mm = header.find("comment unit mm") != std::string_view::npos;
  if (!says_mm && options.unit.empty()) return no_unit(path);
  if (says_mm && !options.unit.empty() && options.unit != "mm") {
    return fail(ErrorCode::kBadInput, fmt::format("{}: is in mm, but {} was stated", shown(path), options.unit));
  }
  auto cloud = read_ply(path);
  if (!cloud) return fail(std::move(cloud));
  const double unit_mm = says_mm ? 1.0 : *unit_in_mm(options.unit);
  MeasuredPoints measured{std::move(cloud->points), std::move(cloud->cov_mm2), cloud->frame};
  for (Eigen::Vector3d& point : measured.points_mm) point *= unit_mm;
  for (Eigen::Matrix3d& cov : measured.cov_mm2) cov *= unit_mm * unit_mm;
  if (measured.points_mm.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: holds no points", shown(path)));
  return measured;
}

}  // namespace

Result<MeasuredPoints> read_measured_points(const fs::path& path, const MeasuredPointsOptions& options) {
  if (!options.unit.empty() && !unit_in_mm(options.unit)) {
    return fail(ErrorCode::kUsage, fmt::format("the unit is mm, m or inch, not '{}'", options.unit));
  }
  if (!options.columns.empty() && options.columns.size() != 3) {
    return fail(ErrorCode::kUsage, fmt::format("three columns are needed, not {}", options.columns.size()));
  }
  const auto contents = read_file(path);
  if (!contents) return tl::unexpected(contents.error());
  std::string_view text = *contents;
  if (text.starts_with("ply")) return read_cloud(path, text, options);
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  if (path.extension() == ".obc") return read_list(path, options);
  if (has_no_header(text)) return read_numbers(path, text, options);
  const auto table = options.columns.empty() ? parse_table(path, text.substr(0, text.find('\n'))) : Result<Table>(Table());
  if (table && table->column("id")) return read_list(path, options);
  return read_columns(path, text, options);
}

}  // namespace crosstie::base
