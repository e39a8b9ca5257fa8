#include "base/point_list.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "base/detail/object_list.h"
#include "base/file.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

constexpr std::size_t kMaxListBytes = std::size_t{256} << 20;

struct Unit {
  std::string_view name;
  double mm;
};
constexpr Unit kUnits[] = {{"mm", 1.0}, {"m", 1000.0}, {"inch", 25.4}};
constexpr std::array<std::string_view, 3> kAxes = {"x", "y", "z"};
constexpr std::array<std::string_view, 6> kCovariances = {"xx", "xy", "xz", "yy", "yz", "zz"};

/// Where a table keeps what; found once, then used row by row.
struct Columns {
  double unit_mm = 1.0;
  std::size_t id = 0;
  std::array<std::size_t, 3> xyz{};
  std::optional<std::array<std::size_t, 3>> sigma;
  std::optional<std::array<std::size_t, 6>> covariance;
};

tl::unexpected<Error> bad(const std::filesystem::path& path, int line, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), line, what));
}

/// The columns prefix + name + suffix: all, none (nothing is written), or an Error that names the missing one.
template <std::size_t N>
Result<bool> find_columns(const Table& table, std::string_view prefix, const std::array<std::string_view, N>& names,
                          std::string_view suffix, std::array<std::size_t, N>& found) {
  std::size_t count = 0;
  std::string missing;
  for (std::size_t i = 0; i < N; ++i) {
    const std::string name = fmt::format("{}{}{}", prefix, names[i], suffix);
    if (const auto column = table.column(name)) {
      found[i] = *column;
      ++count;
    } else if (missing.empty()) {
      missing = name;
    }
  }
  if (count == 0) return false;
  if (count == N) return true;
  return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing", shown(table.path), missing));
}

/// Columns that look like sigmas or covariances, but are none that are known, must not be passed over in silence.
Result<> refuse_misspelt(const Table& table, const std::vector<std::string>& known) {
  for (const std::string& name : table.columns) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const auto meant = nearest_word(name, known);
    if (meant || name.starts_with("sigma") || name.starts_with("cov")) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: unknown column {}{}", shown(table.path), name,
                                                    meant ? fmt::format("; did you mean {}?", *meant) : ""));
    }
  }
  return {};
}

Result<Columns> find_columns(const Table& table, const PointListOptions& options) {
  Columns columns;
  const auto id = table.column("id");
  if (!id) return fail(ErrorCode::kBadInput, fmt::format("{}: the column id is missing", shown(table.path)));
  columns.id = *id;

  // The unit: of the column names, or of the options where the names carry none.
  std::string suffix;
  const Unit* unit = nullptr;
  for (const Unit& candidate : kUnits) {
    const std::string candidate_suffix = fmt::format("_{}", candidate.name);
    auto found = find_columns(table, "", kAxes, candidate_suffix, columns.xyz);
    if (!found) return fail(std::move(found));
    if (!*found) continue;
    if (unit != nullptr) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: coordinates in two units", shown(table.path)));
    }
    unit = &candidate;
    suffix = candidate_suffix;
  }
  if (unit == nullptr) {
    auto found = find_columns(table, "", kAxes, "", columns.xyz);
    if (!found) return fail(std::move(found));
    if (!*found)
      return fail(ErrorCode::kBadInput, fmt::format("{}: the columns x_mm, y_mm and z_mm are missing", shown(table.path)));
    for (const Unit& candidate : kUnits) {
      if (candidate.name == options.unit) unit = &candidate;
    }
    if (unit == nullptr) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}: the columns x, y, z do not say their unit; name them x_mm, y_mm, z_mm or "
                              "state the unit",
                              shown(table.path)));
    }
  } else if (!options.unit.empty() && options.unit != unit->name) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: its columns are in {}, but {} was stated", shown(table.path), unit->name, options.unit));
  }
  columns.unit_mm = unit->mm;

  const std::string covariance_suffix = suffix.empty() ? "" : suffix + "2";
  std::array<std::size_t, 3> sigma{};
  std::array<std::size_t, 6> covariance{};
  auto has_sigma = find_columns(table, "sigma_", kAxes, suffix, sigma);
  if (!has_sigma) return fail(std::move(has_sigma));
  auto has_covariance = find_columns(table, "cov_", kCovariances, covariance_suffix, covariance);
  if (!has_covariance) return fail(std::move(has_covariance));
  if (*has_sigma) columns.sigma = sigma;
  if (*has_covariance) columns.covariance = covariance;

  std::vector<std::string> known = {"id"};
  for (const auto axis : kAxes) {
    known.push_back(fmt::format("{}{}", axis, suffix));
    known.push_back(fmt::format("sigma_{}{}", axis, suffix));
  }
  for (const auto element : kCovariances) known.push_back(fmt::format("cov_{}{}", element, covariance_suffix));
  if (auto good = refuse_misspelt(table, known); !good) return fail(std::move(good));
  return columns;
}

/// The cells at `columns` as numbers.
template <std::size_t N>
Result<std::array<double, N>> numbers(const Table& table, std::size_t row, const std::array<std::size_t, N>& columns) {
  std::array<double, N> values{};
  for (std::size_t i = 0; i < N; ++i) {
    auto value = table.number(row, columns[i]);
    if (!value) return fail(std::move(value));
    values[i] = *value;
  }
  return values;
}

Result<ReferencePoint> read_row(const Table& table, std::size_t row, const Columns& columns) {
  ReferencePoint point;
  auto id = table.integer(row, columns.id);
  if (!id) return fail(std::move(id));
  point.id = *id;
  if (const auto kind = table.column("kind")) point.has_own_id = table.rows[row][*kind] != "uncoded";
  auto xyz = numbers(table, row, columns.xyz);
  if (!xyz) return fail(std::move(xyz));
  point.xyz_mm = Eigen::Vector3d(xyz->data()) * columns.unit_mm;
  const double unit2 = columns.unit_mm * columns.unit_mm;
  if (columns.covariance) {
    auto c = numbers(table, row, *columns.covariance);
    if (!c) return fail(std::move(c));
    Eigen::Matrix3d cov;
    cov << (*c)[0], (*c)[1], (*c)[2], (*c)[1], (*c)[3], (*c)[4], (*c)[2], (*c)[4], (*c)[5];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(cov, Eigen::EigenvaluesOnly);
    if (!(eigen.eigenvalues()[0] >= -1e-9 * std::abs(eigen.eigenvalues()[2]))) {
      return bad(table.path, table.lines[row], "the covariance is not positive semidefinite");
    }
    point.cov_mm2 = cov * unit2;
  } else if (columns.sigma) {
    auto sigma = numbers(table, row, *columns.sigma);
    if (!sigma) return fail(std::move(sigma));
    const Eigen::Array3d values(sigma->data());
    if ((values < 0.0).any()) return bad(table.path, table.lines[row], "a sigma is negative");
    point.cov_mm2 = Eigen::Matrix3d((values.square() * unit2).matrix().asDiagonal());
  }
  if (!point.xyz_mm.allFinite() || (point.cov_mm2 && !point.cov_mm2->allFinite())) {
    return bad(table.path, table.lines[row], "a value is too large");
  }
  return point;
}

/// Sorts by id; ids are 0 or larger and occur once. `lines[i]` is where points[i] was read.
Result<PointList> sorted(const std::filesystem::path& path, std::vector<ReferencePoint> points, const std::vector<int>& lines) {
  std::vector<std::size_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return points[a].id < points[b].id; });
  PointList list;
  list.points.reserve(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const ReferencePoint& point = points[order[i]];
    if (point.id < 0) return bad(path, lines[order[i]], fmt::format("id {}: ids are 0 or larger", point.id));
    if (i > 0 && point.id == list.points.back().id) {
      return bad(path, lines[order[i]], fmt::format("id {} stands already in line {}", point.id, lines[order[i - 1]]));
    }
    list.points.push_back(point);
  }
  return list;
}

}  // namespace

const ReferencePoint* PointList::find(int id) const {
  const auto found =
      std::lower_bound(points.begin(), points.end(), id, [](const ReferencePoint& p, int i) { return p.id < i; });
  return found != points.end() && found->id == id ? &*found : nullptr;
}

Result<PointList> read_point_list(const std::filesystem::path& path, const PointListOptions& options) {
  const bool known_unit = options.unit.empty() || std::any_of(std::begin(kUnits), std::end(kUnits),
                                                              [&](const Unit& u) { return u.name == options.unit; });
  if (!known_unit) return fail(ErrorCode::kUsage, fmt::format("the unit \"{}\" is not one of mm, m, inch", options.unit));
  auto contents = read_file(path, kMaxListBytes);
  if (!contents) return fail(std::move(contents));
  std::vector<ReferencePoint> points;
  std::vector<int> lines;
  if (detail::is_object_list(*contents)) {
    if (!options.unit.empty() && options.unit != "mm") {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}: an AICON object list is in mm, but {} was stated", shown(path), options.unit));
    }
    auto rows = detail::read_object_list(path, *contents);
    if (!rows) return fail(std::move(rows));
    for (auto& row : *rows) {
      points.push_back(std::move(row.point));
      lines.push_back(row.line);
    }
  } else {
    auto table = parse_table(path, *contents);
    if (!table) return fail(std::move(table));
    auto columns = find_columns(*table, options);
    if (!columns) return fail(std::move(columns));
    for (std::size_t row = 0; row < table->rows.size(); ++row) {
      auto point = read_row(*table, row, *columns);
      if (!point) return fail(std::move(point));
      points.push_back(*std::move(point));
    }
    lines = table->lines;
  }
  return sorted(path, std::move(points), lines);
}

Result<> write_point_list(const std::filesystem::path& path, const PointList& list) {
  const auto has_covariance = [](const ReferencePoint& p) { return p.cov_mm2.has_value(); };
  const auto is_diagonal = [](const ReferencePoint& p) { return p.cov_mm2->isDiagonal(0.0); };
  const bool covariances = !list.points.empty() && std::all_of(list.points.begin(), list.points.end(), has_covariance);
  const bool sigmas = covariances && std::all_of(list.points.begin(), list.points.end(), is_diagonal);
  Table table;
  table.columns = {"id", "x_mm", "y_mm", "z_mm"};
  for (const auto axis : kAxes) {
    if (covariances) table.columns.push_back(fmt::format("sigma_{}_mm", axis));
  }
  for (const auto element : kCovariances) {
    if (covariances && !sigmas) table.columns.push_back(fmt::format("cov_{}_mm2", element));
  }
  for (const ReferencePoint& point : list.points) {
    std::vector<std::string> row = {std::to_string(point.id)};
    for (int i = 0; i < 3; ++i) row.push_back(format_double(point.xyz_mm[i]));
    for (int i = 0; covariances && i < 3; ++i) row.push_back(format_double(std::sqrt((*point.cov_mm2)(i, i))));
    for (int i = 0; covariances && !sigmas && i < 3; ++i) {
      for (int j = i; j < 3; ++j) row.push_back(format_double((*point.cov_mm2)(i, j)));
    }
    table.rows.push_back(std::move(row));
  }
  return write_table(path, table);
}

}  // namespace crosstie::base
