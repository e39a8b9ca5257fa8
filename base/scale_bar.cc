// The readers and writers of scale bars, declared in base/point_list.h.
#include <cmath>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "base/file.h"
#include "base/point_list.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

const std::vector<std::string> kColumns = {"id_a",          "id_b",      "length_mm", "sigma_mm",
                                           "temperature_c", "cte_per_k", "role",      "certificate"};
constexpr std::size_t kNeeded = 4;

std::string_view role_name(ScaleBarRole role) {
  switch (role) {
    case ScaleBarRole::kUsed:
      return "used";
    case ScaleBarRole::kCheck:
      return "check";
    case ScaleBarRole::kDefines:
      return "defines";
  }
  return "";
}

std::optional<ScaleBarRole> role_from_name(std::string_view name) {
  for (const ScaleBarRole role : {ScaleBarRole::kUsed, ScaleBarRole::kCheck, ScaleBarRole::kDefines}) {
    if (role_name(role) == name) return role;
  }
  return std::nullopt;
}

Result<> check_header(const Table& table) {
  for (const std::string& name : table.columns) {
    if (std::find(kColumns.begin(), kColumns.end(), name) != kColumns.end()) continue;
    const auto meant = nearest_word(name, kColumns);
    return fail(ErrorCode::kBadInput, fmt::format("{}: unknown column {}{}", shown(table.path), name,
                                                  meant ? fmt::format("; did you mean {}?", *meant) : ""));
  }
  for (std::size_t i = 0; i < kNeeded; ++i) {
    if (!table.column(kColumns[i]))
      return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing", shown(table.path), kColumns[i]));
  }
  return {};
}

/// What is wrong with a bar, or nothing.
std::string fault(const ScaleBar& bar) {
  if (bar.id_a < 0 || bar.id_b < 0) return "ids are 0 or larger";
  if (bar.id_a == bar.id_b) return fmt::format("both ends are id {}", bar.id_a);
  if (!(bar.length_mm > 0.0)) return "length_mm must be positive";
  if (bar.sigma_mm < 0.0) return "sigma_mm is negative";
  if (bar.sigma_mm == 0.0 && bar.role == ScaleBarRole::kUsed) return "sigma_mm of a bar that is used must be positive";
  if (!(std::abs(bar.cte_per_k) < 1e-3)) return "cte_per_k is implausible: steel has 11.5e-6 per K";
  if (!(bar.temperature_c > -60.0 && bar.temperature_c < 200.0)) return "temperature_c is implausible";
  return "";
}

Result<ScaleBar> read_row(const Table& table, std::size_t row) {
  ScaleBar bar;
  for (auto [name, target] : {std::pair{"id_a", &bar.id_a}, std::pair{"id_b", &bar.id_b}}) {
    auto value = table.integer(row, *table.column(name));
    if (!value) return fail(std::move(value));
    *target = *value;
  }
  for (auto [name, target] : {std::pair{"length_mm", &bar.length_mm}, std::pair{"sigma_mm", &bar.sigma_mm},
                              std::pair{"temperature_c", &bar.temperature_c}, std::pair{"cte_per_k", &bar.cte_per_k}}) {
    const auto column = table.column(name);
    const bool optional = target == &bar.temperature_c || target == &bar.cte_per_k;
    if (!column || (optional && table.rows[row][*column].empty())) continue;
    auto value = table.number(row, *column);
    if (!value) return fail(std::move(value));
    *target = *value;
  }
  const auto error = [&](const std::string& what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(table.path), table.lines[row], what));
  };
  if (const auto column = table.column("role"); column && !table.rows[row][*column].empty()) {
    const auto role = role_from_name(table.rows[row][*column]);
    if (!role) return error(fmt::format("role \"{}\" is not used, check or defines", table.rows[row][*column].substr(0, 40)));
    bar.role = *role;
  }
  if (const auto column = table.column("certificate")) bar.certificate = table.rows[row][*column];
  if (const std::string what = fault(bar); !what.empty()) return error(what);
  return bar;
}

}  // namespace

Result<std::vector<ScaleBar>> read_scale_bars(const std::filesystem::path& path) {
  auto table = read_table(path);
  if (!table) return fail(std::move(table));
  if (auto good = check_header(*table); !good) return fail(std::move(good));
  std::vector<ScaleBar> bars;
  std::set<std::tuple<int, int, ScaleBarRole>> seen;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    auto bar = read_row(*table, row);
    if (!bar) return fail(std::move(bar));
    if (!seen.emplace(std::min(bar->id_a, bar->id_b), std::max(bar->id_a, bar->id_b), bar->role).second) {
      return fail(ErrorCode::kBadInput, fmt::format("{}:{}: the bar {}-{} stands already above", shown(path), table->lines[row],
                                                    bar->id_a, bar->id_b));
    }
    bars.push_back(*std::move(bar));
  }
  return bars;
}

Result<> write_scale_bars(const std::filesystem::path& path, const std::vector<ScaleBar>& bars) {
  Table table;
  table.columns = kColumns;
  for (const ScaleBar& bar : bars) {
    table.rows.push_back({std::to_string(bar.id_a), std::to_string(bar.id_b), format_double(bar.length_mm),
                          format_double(bar.sigma_mm), format_double(bar.temperature_c), format_double(bar.cte_per_k),
                          std::string(role_name(bar.role)), bar.certificate});
  }
  return write_table(path, table);
}

}  // namespace crosstie::base
