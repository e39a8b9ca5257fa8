#include "report/tables.h"

#include <algorithm>
#include <cmath>

#include "base/table.h"
#include "base/text.h"

namespace crosstie::report {
namespace {

using base::format_double;
using base::Result;
using base::Table;

std::string role_name(base::ScaleBarRole role) {
  return role == base::ScaleBarRole::kUsed ? "used" : role == base::ScaleBarRole::kCheck ? "check" : "defines";
}

void append(std::vector<std::string>& row, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) row.push_back(format_double(values(i)));
}

void append_upper(std::vector<std::string>& row, const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = i; j < matrix.cols(); ++j) row.push_back(format_double(matrix(i, j)));
  }
}

Table points_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {
      "id",         "kind",       "x_mm", "y_mm",      "z_mm",   "cov_xx_mm2", "cov_xy_mm2", "cov_xz_mm2",      "cov_yy_mm2",
      "cov_yz_mm2", "cov_zz_mm2", "rays", "angle_rad", "rms_px", "max_w",      "max_px",     "least_redundancy"};
  for (const base::AdjustedPoint& point : network.points) {
    std::vector<std::string> row = {std::to_string(point.id), point.kind};
    append(row, point.xyz_mm);
    append_upper(row, point.cov_mm2);
    row.push_back(std::to_string(point.rays));
    append(row, Eigen::Vector3d(point.angle_rad, point.rms_px, point.max_w));
    append(row, Eigen::Vector2d(point.max_px, point.least_redundancy));
    table.rows.push_back(std::move(row));
  }
  return table;
}

void add_pose_columns(Table& table) {
  table.columns.insert(table.columns.end(),
                       {"qw", "qx", "qy", "qz", "x_mm", "y_mm", "z_mm", "sigma_position_x_mm", "sigma_position_y_mm",
                        "sigma_position_z_mm", "sigma_rotation_x_rad", "sigma_rotation_y_rad", "sigma_rotation_z_rad"});
}

void append_pose(std::vector<std::string>& row, const base::Pose& pose, const base::Matrix6d& cov) {
  const Eigen::Quaterniond& q = pose.rotation;
  append(row, Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
  append(row, pose.translation_mm);
  append(row, base::position_covariance(pose, cov).diagonal().cwiseMax(0.0).cwiseSqrt());
  append(row, cov.diagonal().head<3>().cwiseMax(0.0).cwiseSqrt());
}

Table images_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"image", "camera"};
  add_pose_columns(table);
  table.columns.insert(table.columns.end(), {"rays", "rms_px", "max_px", "coverage"});
  for (const base::AdjustedImage& image : network.images) {
    std::vector<std::string> row = {image.name, image.camera};
    append_pose(row, image.network_from_camera, image.cov);
    row.push_back(std::to_string(image.rays));
    append(row, Eigen::Vector3d(image.rms_px, image.max_px, image.coverage));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table cameras_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"camera", "model", "width_px", "height_px", "estimated", "parameter", "value", "sigma", "significance_p"};
  for (const base::AdjustedCamera& one : network.cameras) {
    const auto names = base::parameter_names(one.camera.model());
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const bool known = one.camera.covariance().size() > 0;
      const bool tested = k < one.significance_p.size() && std::isfinite(one.significance_p(k));
      table.rows.push_back({one.name, std::string(base::lens_model_name(one.camera.model())),
                            std::to_string(one.camera.width_px()), std::to_string(one.camera.height_px()),
                            one.estimated ? "yes" : "no", std::string(names[i]), format_double(one.camera.parameters()(k)),
                            known ? format_double(std::sqrt(std::max(0.0, one.camera.covariance()(k, k)))) : "",
                            tested ? format_double(one.significance_p(k)) : ""});
    }
  }
  return table;
}

Table residuals_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"image",      "id",           "x_px",         "y_px", "residual_x_px", "residual_y_px", "sigma_x_px",
                   "sigma_y_px", "redundancy_x", "redundancy_y", "w"};
  for (const base::AdjustedObservation& one : network.residuals) {
    std::vector<std::string> row = {network.images.at(static_cast<std::size_t>(one.image)).name,
                                    std::to_string(network.points.at(static_cast<std::size_t>(one.point)).id)};
    append(row, one.measured_px);
    append(row, one.residual_px);
    append(row, one.sigma_px);
    append(row, one.redundancy);
    row.push_back(format_double(one.w));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table scale_bars_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"id_a",
                   "id_b",
                   "role",
                   "length_mm",
                   "length_sigma_mm",
                   "temperature_c",
                   "cte_per_k",
                   "length_at_temperature_mm",
                   "measured_mm",
                   "measured_sigma_mm",
                   "deviation_mm",
                   "w",
                   "certificate"};
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    const double known = bar.bar.length_at_temperature_mm();
    table.rows.push_back({std::to_string(bar.bar.id_a), std::to_string(bar.bar.id_b), role_name(bar.bar.role),
                          format_double(bar.bar.length_mm), format_double(bar.bar.sigma_mm),
                          format_double(bar.bar.temperature_c), format_double(bar.bar.cte_per_k), format_double(known),
                          format_double(bar.measured_mm), format_double(bar.sigma_mm), format_double(bar.measured_mm - known),
                          format_double(bar.w), bar.bar.certificate});
  }
  return table;
}

Table rigs_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"rig", "camera", "stations"};
  add_pose_columns(table);
  for (const base::AdjustedRig& rig : network.rigs) {
    for (const base::AdjustedMount& mount : rig.mounts) {
      std::vector<std::string> row = {rig.name, mount.camera, std::to_string(rig.stations)};
      append_pose(row, mount.rig_from_camera, mount.cov);
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

Table control_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"id", "residual_x_mm", "residual_y_mm", "residual_z_mm", "sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "w"};
  for (const base::AdjustedControl& one : network.control) {
    std::vector<std::string> row = {std::to_string(one.id)};
    append(row, one.residual_mm);
    append(row, one.sigma_mm);
    row.push_back(format_double(one.w));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table rejected_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"image", "id", "reason", "w"};
  for (const base::RejectedObservation& one : network.rejected) {
    table.rows.push_back({one.image, std::to_string(one.id), one.reason, format_double(one.w)});
  }
  return table;
}

Table unmatched_table(const base::AdjustedNetwork& network) {
  Table table;
  table.columns = {"image", "x_px", "y_px", "why"};
  for (const base::UnmatchedDot& dot : network.uncoded.left) {
    table.rows.push_back({dot.image, format_double(dot.centre_px.x()), format_double(dot.centre_px.y()),
                          dot.ambiguous ? "ambiguous" : "unmatched"});
  }
  return table;
}

Table deviations_table(const base::Verification& verification) {
  Table table;
  table.columns = {"id",
                   "used",
                   "reference_x_mm",
                   "reference_y_mm",
                   "reference_z_mm",
                   "measured_x_mm",
                   "measured_y_mm",
                   "measured_z_mm",
                   "dx_mm",
                   "dy_mm",
                   "dz_mm",
                   "d3_mm",
                   "sigma_x_mm",
                   "sigma_y_mm",
                   "sigma_z_mm",
                   "untransformed_dx_mm",
                   "untransformed_dy_mm",
                   "untransformed_dz_mm",
                   "reference_id"};
  std::vector<base::Deviation> all = verification.points;
  all.insert(all.end(), verification.by_position.points.begin(), verification.by_position.points.end());
  for (const base::Deviation& one : all) {
    std::vector<std::string> row = {std::to_string(one.id), one.used ? "yes" : "no"};
    append(row, one.reference_mm);
    append(row, one.measured_mm);
    append(row, one.deviation_mm);
    row.push_back(format_double(one.deviation_mm.norm()));
    append(row, one.sigma_mm);
    append(row, one.untransformed_mm);
    row.push_back(std::to_string(one.reference_id));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table lengths_table(const base::Verification& verification) {
  Table table;
  table.columns = {"id_a", "id_b", "nominal_mm", "measured_mm", "error_mm", "sigma_mm", "mpe_mm"};
  for (const base::LengthDeviation& one : verification.lengths) {
    table.rows.push_back({std::to_string(one.id_a), std::to_string(one.id_b), format_double(one.nominal_mm),
                          format_double(one.measured_mm), format_double(one.measured_mm - one.nominal_mm),
                          format_double(one.sigma_mm), format_double(one.mpe_mm)});
  }
  return table;
}

Result<> write_all(const std::filesystem::path& folder, const std::vector<std::pair<std::string, Table>>& tables) {
  for (const auto& [name, table] : tables) {
    if (auto written = base::write_table(folder / name, table); !written) return base::fail(std::move(written));
  }
  return {};
}

}  // namespace

Result<> write_bundle_tables(const std::filesystem::path& folder, const base::AdjustedNetwork& network) {
  return write_all(folder, {{"points.csv", points_table(network)},
                            {"images.csv", images_table(network)},
                            {"cameras.csv", cameras_table(network)},
                            {"residuals.csv", residuals_table(network)},
                            {"scale_bars.csv", scale_bars_table(network)},
                            {"rigs.csv", rigs_table(network)},
                            {"control.csv", control_table(network)},
                            {"rejected.csv", rejected_table(network)},
                            {"unmatched.csv", unmatched_table(network)}});
}

Result<> write_verification_tables(const std::filesystem::path& folder, const base::Verification& verification) {
  return write_all(folder, {{"deviations.csv", deviations_table(verification)}, {"lengths.csv", lengths_table(verification)}});
}

}  // namespace crosstie::report
