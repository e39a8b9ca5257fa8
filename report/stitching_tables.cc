#include "report/stitching_tables.h"

#include <string>
#include <utility>
#include <vector>

#include "base/table.h"
#include "base/text.h"

namespace crosstie::report {
namespace {

using base::format_double;
using base::Stitching;
using base::Table;

void append(std::vector<std::string>& row, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) row.push_back(format_double(values(i)));
}

Table stations_table(const Stitching& stitching) {
  Table table;
  table.columns = {"station", "axis_mm", "qw", "qx", "qy", "qz", "x_mm", "y_mm", "z_mm", "markers", "points", "off_axis_w"};
  for (const base::StitchedStation& station : stitching.stations) {
    const Eigen::Quaterniond& q = station.machine_from_rig.rotation;
    std::vector<std::string> row = {station.name, station.axis_mm ? format_double(*station.axis_mm) : ""};
    append(row, Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
    append(row, station.machine_from_rig.translation_mm);
    row.push_back(std::to_string(station.markers));
    row.push_back(std::to_string(station.points));
    row.push_back(station.off_axis ? format_double(station.off_axis_w) : "");
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table directions_table(const Stitching& stitching) {
  Table table;
  table.columns = {"station",       "direction",        "unit", "sigma", "share_markers", "share_reference", "share_axis",
                   "share_surface", "share_calibration"};
  for (const base::StitchedStation& station : stitching.stations) {
    for (const base::DirectionKnowledge& direction : station.directions) {
      const base::SourceShares& share = direction.share;
      table.rows.push_back({station.name, direction.name, direction.angle ? "rad" : "mm", format_double(direction.sigma),
                            format_double(share.markers), format_double(share.reference), format_double(share.axis),
                            format_double(share.surface), format_double(share.calibration)});
    }
  }
  return table;
}

Table overlap_table(const Stitching& stitching) {
  const auto name = [&](int station) { return stitching.stations[static_cast<std::size_t>(station)].name; };
  Table table;
  table.columns = {"a", "b", "x_mm", "y_mm", "z_mm", "difference_mm", "sigma_mm"};
  for (const base::StitchedOverlap& overlap : stitching.overlaps) {
    for (const base::OverlapCell& cell : overlap.cells) {
      std::vector<std::string> row = {name(overlap.a), name(overlap.b)};
      append(row, cell.centre_mm);
      row.push_back(format_double(cell.difference_mm));
      row.push_back(format_double(cell.sigma_mm));
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

Table markers_table(const Stitching& stitching) {
  Table table;
  table.columns = {"id",
                   "x_mm",
                   "y_mm",
                   "z_mm",
                   "sigma_x_mm",
                   "sigma_y_mm",
                   "sigma_z_mm",
                   "stations",
                   "max_w",
                   "reference_residual_x_mm",
                   "reference_residual_y_mm",
                   "reference_residual_z_mm"};
  for (const base::StitchedMarker& marker : stitching.markers) {
    std::vector<std::string> row = {std::to_string(marker.id)};
    append(row, marker.xyz_mm);
    append(row, marker.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt());
    row.push_back(std::to_string(marker.stations.size()));
    row.push_back(format_double(marker.max_w));
    if (marker.in_reference) {
      append(row, marker.reference_residual_mm);
    } else {
      row.insert(row.end(), 3, "");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table rejected_table(const Stitching& stitching) {
  Table table;
  table.columns = {"station", "id", "distance_mm", "w", "reason"};
  for (const base::RejectedSighting& one : stitching.rejected) {
    table.rows.push_back({one.station < 0 ? "list" : stitching.stations[static_cast<std::size_t>(one.station)].name,
                          std::to_string(one.id), format_double(one.distance_mm), format_double(one.w), one.reason});
  }
  return table;
}

}  // namespace

base::Result<> write_stitching_tables(const std::filesystem::path& folder, const Stitching& stitching) {
  const std::pair<const char*, Table> tables[] = {{"stations.csv", stations_table(stitching)},
                                                  {"directions.csv", directions_table(stitching)},
                                                  {"overlap.csv", overlap_table(stitching)},
                                                  {"markers.csv", markers_table(stitching)},
                                                  {"rejected.csv", rejected_table(stitching)}};
  for (const auto& [name, table] : tables) {
    if (auto written = base::write_table(folder / name, table); !written) return written;
  }
  return {};
}

}  // namespace crosstie::report
