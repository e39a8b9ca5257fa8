#include "base/sphere_list.h"

#include <map>

#include <fmt/format.h>

#include "base/file.h"
#include "base/point_list.h"
#include "base/table.h"

namespace crosstie::base {
namespace {

tl::unexpected<Error> bad(const Table& table, std::size_t row, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(table.path), table.lines[row], what));
}

/// The list's points and the table that they stand in, if it is one.
struct SphereTable {
  PointList list;
  std::optional<Table> table;
  std::map<int, std::size_t> row_of;  ///< by id
};

Result<SphereTable> read_spheres(const std::filesystem::path& path) {
  auto list = read_point_list(path);
  if (!list) return fail(std::move(list));
  if (list->points.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: the list holds no sphere", shown(path)));
  for (const ReferencePoint& point : list->points) {
    if (point.cov_mm2) continue;
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: sphere {} has no sigmas; a frame with sigmas needs them: add the columns "
                            "sigma_x_mm, sigma_y_mm, sigma_z_mm",
                            shown(path), point.id));
  }
  SphereTable spheres{*std::move(list), std::nullopt, {}};
  if (auto table = read_table(path); table && table->column("id")) {
    for (std::size_t row = 0; row < table->rows.size(); ++row) {
      if (const auto id = table->integer(row, *table->column("id"))) spheres.row_of[*id] = row;
    }
    spheres.table = *std::move(table);
  }
  return spheres;
}

}  // namespace

Result<std::vector<ReferenceSphere>> read_reference_spheres(const std::filesystem::path& path) {
  const auto read = read_spheres(path);
  if (!read) return tl::unexpected<Error>(read.error());
  const auto column = read->table ? read->table->column("diameter_mm") : std::nullopt;
  std::vector<ReferenceSphere> spheres;
  for (const ReferencePoint& point : read->list.points) {
    ReferenceSphere& sphere = spheres.emplace_back(ReferenceSphere{point.id, point.xyz_mm, *point.cov_mm2, 0.0});
    if (!column) continue;
    const std::size_t row = read->row_of.at(point.id);
    const auto diameter = read->table->number(row, *column);
    if (!diameter) return tl::unexpected<Error>(diameter.error());
    if (!(*diameter > 0.0)) return bad(*read->table, row, fmt::format("a diameter of {} mm", *diameter));
    sphere.diameter_mm = *diameter;
  }
  return spheres;
}

Result<std::vector<ProbedSphere>> read_probed_spheres(const std::filesystem::path& path) {
  const auto read = read_spheres(path);
  if (!read) return tl::unexpected<Error>(read.error());
  const auto column = read->table ? read->table->column("axes") : std::nullopt;
  std::vector<ProbedSphere> spheres;
  for (const ReferencePoint& point : read->list.points) {
    ProbedSphere& sphere = spheres.emplace_back();
    sphere.id = point.id;
    sphere.centre_mm = point.xyz_mm;
    sphere.cov_mm2 = *point.cov_mm2;
    if (!column) continue;
    const std::size_t row = read->row_of.at(point.id);
    const std::string& axes = read->table->rows[row][*column];
    if (axes.empty() || axes.find_first_not_of("xyz") != std::string::npos) {
      return bad(*read->table, row, fmt::format("axes holds x, y and z of the coordinates that count, not '{}'", axes));
    }
    for (std::size_t i = 0; i < 3; ++i) sphere.axes[i] = axes.find("xyz"[i]) != std::string::npos;
  }
  return spheres;
}

Result<std::vector<ProbeHits>> read_probe_hits(const std::filesystem::path& path) {
  const auto table = read_table(path);
  if (!table) return tl::unexpected<Error>(table.error());
  std::array<std::size_t, 4> columns{};
  constexpr std::array<const char*, 4> kNames = {"sphere", "x_mm", "y_mm", "z_mm"};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto column = table->column(kNames[i]);
    if (!column) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing; touches of the probe have the columns "
                                                    "sphere, x_mm, y_mm, z_mm",
                                                    shown(path), kNames[i]));
    }
    columns[i] = *column;
  }
  std::map<int, ProbeHits> by_id;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto id = table->integer(row, columns[0]);
    if (!id) return tl::unexpected<Error>(id.error());
    if (*id < 0) return bad(*table, row, fmt::format("sphere {}: ids are 0 or larger", *id));
    Eigen::Vector3d tip;
    for (int i = 0; i < 3; ++i) {
      const auto value = table->number(row, columns[static_cast<std::size_t>(i) + 1]);
      if (!value) return tl::unexpected<Error>(value.error());
      tip(i) = *value;
    }
    ProbeHits& hits = by_id[*id];
    hits.id = *id;
    hits.tips_mm.push_back(tip);
  }
  if (by_id.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: the list holds no touch", shown(path)));
  std::vector<ProbeHits> all;
  for (auto& [id, hits] : by_id) all.push_back(std::move(hits));
  return all;
}

}  // namespace crosstie::base
