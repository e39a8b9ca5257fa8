#include "base/detail/object_list.h"

#include <algorithm>
#include <limits>
#include <string>

#include <fmt/format.h>

#include "base/file.h"
#include "base/text.h"

namespace crosstie::base::detail {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::string_view kNoSigma = "fix";
constexpr std::size_t kMinCells = 9;
constexpr std::size_t kMaxCells = 11;

/// The cells of a line, at most kMaxCells + 1 of them.
std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t at = 0; cells.size() <= kMaxCells;) {
    at = line.find_first_not_of(" \t\r", at);
    if (at == std::string_view::npos) break;
    const std::size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    cells.push_back(line.substr(at, end - at));
    at = end;
  }
  return cells;
}

/// Calls `use(line, number)` for each line until it returns false.
template <typename Use>
void for_each_line(std::string_view contents, Use use) {
  if (contents.starts_with(kByteOrderMark)) contents.remove_prefix(kByteOrderMark.size());
  for (int number = 1; !contents.empty(); ++number) {
    const std::size_t end = contents.find('\n');
    if (!use(contents.substr(0, end), number) || end == std::string_view::npos) return;
    contents.remove_prefix(end + 1);
  }
}

struct Flagged {
  ObjectListRow row;
  bool active = false;
};

/// The error is the reason.
tl::expected<Flagged, std::string> read_row(const std::vector<std::string_view>& cells, int line) {
  const auto bad = [](std::string reason) { return tl::unexpected<std::string>(std::move(reason)); };
  if (cells.size() < kMinCells || cells.size() > kMaxCells) {
    return bad(fmt::format("an object list has {} to {} cells a line", kMinCells, kMaxCells));
  }
  Flagged result;
  result.row.line = line;
  const auto id = parse_int(cells[0]);
  if (!id || *id < 0 || *id > std::numeric_limits<int>::max())
    return bad(fmt::format("\"{}\" is no id", cells[0].substr(0, 40)));
  result.row.point.id = static_cast<int>(*id);

  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();
  int given = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    const auto value = parse_double(cells[1 + i]);
    if (!value) return bad(fmt::format("\"{}\" is no finite number", cells[1 + i].substr(0, 40)));
    result.row.point.xyz_mm[axis] = *value;
    if (cells[4 + i] == kNoSigma) continue;
    const auto sigma = parse_double(cells[4 + i]);
    if (!sigma || *sigma < 0.0) return bad(fmt::format("\"{}\" is no sigma", cells[4 + i].substr(0, 40)));
    sigma_mm[axis] = *sigma;
    ++given;
  }
  if (given != 0 && given != 3) return bad("sigmas for some of the three coordinates only");
  if (given == 3) result.row.point.cov_mm2 = Eigen::Matrix3d(sigma_mm.cwiseAbs2().asDiagonal());

  for (std::size_t i = 7; i < cells.size(); ++i) {
    if (!parse_int(cells[i])) return bad(fmt::format("\"{}\" is no integer", cells[i].substr(0, 40)));
  }
  result.active = parse_int(cells[8]) != 0;
  return result;
}

}  // namespace

bool is_object_list(std::string_view contents) {
  bool result = false;
  for_each_line(contents, [&](std::string_view line, int) {
    const auto cells = cells_of(line);
    if (cells.empty() || cells[0].starts_with('#')) return true;
    result = cells.size() >= kMinCells && cells.size() <= kMaxCells &&
             std::all_of(cells.begin(), cells.end(), [](std::string_view c) { return c == kNoSigma || parse_double(c); });
    return false;
  });
  return result;
}

Result<std::vector<ObjectListRow>> read_object_list(const std::filesystem::path& path, std::string_view contents) {
  std::vector<Flagged> all;
  std::optional<Error> error;
  for_each_line(contents, [&](std::string_view line, int number) {
    const auto cells = cells_of(line);
    if (cells.empty() || cells[0].starts_with('#')) return true;
    auto row = read_row(cells, number);
    if (!row) {
      error = Error{ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), number, row.error())};
      return false;
    }
    all.push_back(*std::move(row));
    return true;
  });
  if (error) return tl::unexpected<Error>(*std::move(error));
  const bool flag_is_used = std::any_of(all.begin(), all.end(), [](const Flagged& f) { return f.active; });
  std::vector<ObjectListRow> rows;
  for (Flagged& flagged : all) {
    if (flagged.active || !flag_is_used) rows.push_back(std::move(flagged.row));
  }
  return rows;
}

}  // namespace crosstie::base::detail
