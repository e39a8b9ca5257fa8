#include "report/commissioning_tables.h"

#include <cmath>

#include "base/table.h"
#include "base/text.h"

namespace crosstie::report {
namespace {

using base::Commissioning;
using base::format_double;
using base::Table;

void append(std::vector<std::string>& row, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) row.push_back(format_double(values(i)));
}

Table stations_table(const Commissioning& result) {
  Table table;
  table.columns = {"station",
                   "axis_mm",
                   "qw",
                   "qx",
                   "qy",
                   "qz",
                   "x_mm",
                   "y_mm",
                   "z_mm",
                   "sigma_position_x_mm",
                   "sigma_position_y_mm",
                   "sigma_position_z_mm",
                   "sigma_rotation_x_rad",
                   "sigma_rotation_y_rad",
                   "sigma_rotation_z_rad",
                   "off_along_mm",
                   "w"};
  for (const base::CommissionedStation& one : result.stations) {
    std::vector<std::string> row = {one.name, format_double(one.axis_mm)};
    const Eigen::Quaterniond& q = one.machine_from_rig.rotation;
    append(row, Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
    append(row, one.machine_from_rig.translation_mm);
    append(row, base::position_covariance(one.machine_from_rig, one.cov).diagonal().cwiseMax(0.0).cwiseSqrt());
    append(row, one.cov.diagonal().head<3>().cwiseMax(0.0).cwiseSqrt());
    append(row, Eigen::Vector2d(one.off_along_mm, one.w));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table spheres_table(const Commissioning& result) {
  Table table;
  table.columns = {"id",
                   "x_mm",
                   "y_mm",
                   "z_mm",
                   "residual_x_mm",
                   "residual_y_mm",
                   "residual_z_mm",
                   "sigma_x_mm",
                   "sigma_y_mm",
                   "sigma_z_mm",
                   "w",
                   "left_out_x_mm",
                   "left_out_y_mm",
                   "left_out_z_mm",
                   "left_out_sigma_x_mm",
                   "left_out_sigma_y_mm",
                   "left_out_sigma_z_mm"};
  for (const base::CommissionedSphere& one : result.spheres) {
    std::vector<std::string> row = {std::to_string(one.id)};
    append(row, one.centre_mm);
    append(row, one.residual_mm);
    append(row, one.sigma_mm);
    row.push_back(format_double(one.w));
    if (one.left_out_mm) {
      append(row, *one.left_out_mm);
      append(row, one.left_out_sigma_mm);
    } else {
      row.resize(table.columns.size());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table terms_table(const Commissioning& result) {
  Table table;
  table.columns = {"motion", "order", "unit", "coefficient", "sigma", "found", "found_sigma", "p", "significant"};
  for (std::size_t i = 0; i < result.frame.axis.terms.size(); ++i) {
    const base::ErrorMotion& term = result.frame.axis.terms[i];
    const std::optional<double> sigma = result.frame.term_sigma(i);
    table.rows.push_back({term.name, std::to_string(term.order), term.angle ? "rad" : "mm",
                          sigma ? format_double(term.value) : std::string(), sigma ? format_double(*sigma) : std::string(),
                          format_double(term.coefficient), format_double(term.sigma), format_double(term.p),
                          term.significant ? "yes" : "no"});
  }
  return table;
}

Table residuals_table(const Commissioning& result) {
  Table table;
  table.columns = {"image", "id", "x_px", "y_px", "residual_x_px", "residual_y_px", "sigma_x_px", "sigma_y_px", "w"};
  for (const base::CommissionedRay& ray : result.residuals) {
    std::vector<std::string> row = {result.images.at(static_cast<std::size_t>(ray.image)).name, std::to_string(ray.id)};
    for (const Eigen::Vector2d& pair : {ray.measured_px, ray.residual_px, ray.sigma_px}) append(row, pair);
    row.push_back(format_double(ray.w));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table markers_table(const Commissioning& result) {
  Table table;
  table.columns = {"id",         "rays",       "x_mm",      "y_mm", "z_mm", "residual_x_mm", "residual_y_mm", "residual_z_mm",
                   "sigma_x_mm", "sigma_y_mm", "sigma_z_mm"};
  for (const base::CommissionedMarker& marker : result.markers) {
    std::vector<std::string> row = {std::to_string(marker.id), std::to_string(marker.rays)};
    append(row, marker.xyz_mm);
    append(row, marker.residual_mm);
    append(row, marker.sigma_mm);
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table rejected_table(const Commissioning& result) {
  Table table;
  table.columns = {"subject", "id", "reason", "w"};
  for (const Commissioning::Rejected& one : result.rejected) {
    table.rows.push_back({one.subject, std::to_string(one.id), one.reason, format_double(one.w)});
  }
  return table;
}

}  // namespace

base::Result<> write_commissioning_tables(const std::filesystem::path& folder, const Commissioning& result) {
  for (const auto& [name, table] :
       {std::pair("stations.csv", stations_table(result)), std::pair("spheres.csv", spheres_table(result)),
        std::pair("terms.csv", terms_table(result)), std::pair("residuals.csv", residuals_table(result)),
        std::pair("markers.csv", markers_table(result)), std::pair("rejected.csv", rejected_table(result))}) {
    if (auto written = base::write_table(folder / name, table); !written) return base::fail(std::move(written));
  }
  return {};
}

}  // namespace crosstie::report
