#include "app/surface_task.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/ply.h"
#include "base/table.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;

/// machine_from_part of an edge result; nothing where it has none.
Result<std::optional<base::Pose>> part_pose(const fs::path& edge_result) {
  std::error_code ignored;
  if (!fs::exists(edge_result, ignored)) return std::optional<base::Pose>();
  const auto json = base::read_json(edge_result);
  if (!json) return tl::unexpected(json.error());
  const auto found = json->find("machine_from_part");
  if (found == json->end() || !found->is_array() || found->size() != 16) return std::optional<base::Pose>();
  Eigen::Matrix4d matrix;
  for (Eigen::Index i = 0; i < 16; ++i) {
    const auto& value = (*found)[static_cast<std::size_t>(i)];
    if (!value.is_number())
      return fail(ErrorCode::kBadInput, fmt::format("{}: machine_from_part is no matrix", base::shown(edge_result)));
    matrix(i / 4, i % 4) = value.get<double>();
  }
  auto pose = base::pose_from_matrix(matrix);
  if (!pose)
    return fail(pose.error().code, fmt::format("{}: machine_from_part: {}", base::shown(edge_result), pose.error().message));
  return std::optional<base::Pose>(*pose);
}

verify::NominalShell moved(const verify::NominalShell& shell, const base::Pose& pose) {
  verify::NominalShell other = shell;
  other.axis_point_mm = pose * shell.axis_point_mm;
  other.axis_direction = pose.rotation * shell.axis_direction;
  return other;
}

/// Against the nominal shell itself.
Result<base::SurfaceDeviations> against_shell(const base::Cloud& cloud, const verify::NominalShell& nominal,
                                              const verify::SurfaceOptions& options) {
  if (nominal.half_angle_rad == 0.0) {
    return verify::compare_surface(
        cloud, math::Cylinder{nominal.axis_point_mm, nominal.axis_direction.normalized(), nominal.radius_mm}, options);
  }
  const double sense = nominal.half_angle_rad < 0.0 ? -1.0 : 1.0;
  const math::Cone cone{nominal.axis_point_mm, sense * nominal.axis_direction.normalized(),
                        nominal.radius_mm * std::cos(nominal.half_angle_rad), std::abs(nominal.half_angle_rad)};
  return verify::compare_surface(cloud, cone, options);
}

base::Cloud brought(base::Cloud cloud, const base::Pose& pose) {
  const Eigen::Matrix3d turn = pose.rotation.toRotationMatrix();
  for (auto& p : cloud.points) p = pose * p;
  for (auto& n : cloud.normals) n = turn * n;
  for (auto& c : cloud.cov_mm2) c = turn * c * turn.transpose();
  return cloud;
}

}  // namespace

Result<base::EdgeCurve> read_rim_table(const fs::path& file) {
  const auto table = base::read_table(file);
  if (!table) return tl::unexpected(table.error());
  std::vector<std::size_t> columns;
  for (const char* name : {"x_mm", "y_mm", "z_mm", "nx", "ny", "nz"}) {
    const auto column = table->column(name);
    if (!column) return fail(ErrorCode::kBadInput, fmt::format("{}: a rim needs the column {}", base::shown(file), name));
    columns.push_back(*column);
  }
  const auto sigma_u = table->column("sigma_u_mm");
  const auto sigma_v = table->column("sigma_v_mm");
  base::EdgeCurve rim;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    base::EdgePoint p;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const auto value = table->number(row, columns[k]);
      if (!value) return tl::unexpected(value.error());
      (k < 3 ? p.point_mm : p.normal)(static_cast<Eigen::Index>(k % 3)) = *value;
    }
    for (const auto& [column, sigma] : {std::pair{sigma_u, &p.sigma_u_mm}, std::pair{sigma_v, &p.sigma_v_mm}}) {
      if (!column) continue;
      const auto value = table->number(row, *column);
      if (!value) return tl::unexpected(value.error());
      *sigma = *value;
    }
    if (!(p.normal.norm() > 0.1)) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}:{}: the normal has no direction", base::shown(file), table->lines[row]));
    }
    p.normal.normalize();
    if (!rim.points.empty()) rim.length_mm += (p.point_mm - rim.points.back().point_mm).norm();
    p.s_mm = rim.length_mm;
    rim.points.push_back(p);
  }
  if (rim.points.size() < 3)
    return fail(ErrorCode::kBadInput, fmt::format("{}: a rim of {} points", base::shown(file), rim.points.size()));
  // Closed where the way back to its beginning is no longer than a few of its steps.
  const double step = rim.length_mm / static_cast<double>(rim.points.size() - 1);
  rim.closed = (rim.points.front().point_mm - rim.points.back().point_mm).norm() < 5.0 * step;
  return rim;
}

Result<std::optional<SurfaceTask>> surface_task(const Job& job, const fs::path& stitch, const fs::path& edge) {
  std::error_code ignored;
  if (!fs::exists(stitch / "cloud.ply", ignored)) return std::optional<SurfaceTask>();
  const bool has_shell = job.part.axis_point_mm && job.part.radius_mm;
  if (!job.reference_surface && !has_shell) return std::optional<SurfaceTask>();
  SurfaceTask task;
  task.cloud = stitch / "cloud.ply";
  task.limits = job.limits;
  task.best_fit = job.surface_best_fit;
  const auto machine_from_part = part_pose(edge / "result.json");
  if (!machine_from_part) return tl::unexpected(machine_from_part.error());
  const bool part_is_known = *machine_from_part || job.part.position == "none";
  const base::Pose pose = machine_from_part->value_or(base::Pose{});
  const bool in_part = job.reference_surface && job.surface_frame == "part";
  if (in_part && !part_is_known) {
    return fail(ErrorCode::kBadInput, "[reference] surface_frame = \"part\", but no result of edge says where the part lies");
  }
  if (in_part) task.reference_from_measured = pose.inverse();
  if (job.reference_surface) task.surface = job.resolve(*job.reference_surface);
  if (has_shell && part_is_known) {
    const verify::NominalShell drawn{*job.part.axis_point_mm, *job.part.axis_direction, *job.part.radius_mm,
                                     job.part.half_angle_rad};
    task.nominal = in_part ? drawn : moved(drawn, pose);
    task.shell = job.part.half_angle_rad == 0.0 ? "cylinder" : "cone";
  }
  return std::optional<SurfaceTask>(task);
}

std::vector<fs::path> surface_files(const SurfaceTask& task) {
  std::vector<fs::path> files;
  for (const auto& file : {task.cloud, task.surface, task.edge, task.edge_reference}) {
    if (file) files.push_back(*file);
  }
  return files;
}

nlohmann::ordered_json surface_options(const SurfaceTask& task) {
  nlohmann::ordered_json json = {
      {"shell", task.shell}, {"best_fit", task.best_fit}, {"tolerance_mm", task.limits.surface_tolerance_mm}};
  nlohmann::ordered_json matrix = nlohmann::ordered_json::array();
  const Eigen::Matrix4d pose = task.reference_from_measured.matrix();
  for (Eigen::Index i = 0; i < 16; ++i) matrix.push_back(pose(i / 4, i % 4));
  json["reference_from_measured"] = std::move(matrix);
  if (task.nominal) {
    const auto list = [](const Eigen::Vector3d& v) { return nlohmann::ordered_json::array({v.x(), v.y(), v.z()}); };
    json["nominal_shell"] = {{"axis_point_mm", list(task.nominal->axis_point_mm)},
                             {"axis_direction", list(task.nominal->axis_direction)},
                             {"radius_mm", task.nominal->radius_mm},
                             {"half_angle_rad", task.nominal->half_angle_rad}};
  }
  if (task.limits.surface_p95_mm) json["surface_p95_mm"] = *task.limits.surface_p95_mm;
  if (task.limits.edge_rms_mm) json["edge_rms_mm"] = *task.limits.edge_rms_mm;
  return json;
}

Result<base::SurfaceVerification> compare_surfaces(const SurfaceTask& task, Session& session) {
  base::SurfaceVerification result;
  verify::SurfaceOptions options;
  options.tolerance_mm = task.limits.surface_tolerance_mm;
  options.reference_from_measured = task.reference_from_measured;
  options.best_fit = task.best_fit;
  if (task.cloud) {
    const auto cloud = base::read_ply(*task.cloud);
    if (!cloud) return tl::unexpected(cloud.error());
    const auto named = [&](const base::Error& error) {
      return fail(error.code, fmt::format("{}: {}", base::shown(*task.cloud), error.message));
    };
    if (task.surface) {
      const auto reference = base::read_ply_mesh(*task.surface);
      if (!reference) return tl::unexpected(reference.error());
      auto compared = verify::compare_surface(*cloud, *reference, options, session.progress());
      if (!compared) return named(compared.error());
      result.surface = *std::move(compared);
    } else if (task.nominal) {
      auto compared = against_shell(*cloud, *task.nominal, options);
      if (!compared) return named(compared.error());
      result.surface = *std::move(compared);
    }
    if (!task.shell.empty()) {
      const base::Pose pose = result.surface ? result.surface->reference_from_measured : task.reference_from_measured;
      auto shell = verify::compare_shell(brought(*cloud, pose), task.nominal, {.cone = task.shell == "cone"});
      if (!shell) return named(shell.error());
      result.shape = *std::move(shell);
    }
  }
  if (task.edge && task.edge_reference) {
    auto measured = read_rim_table(*task.edge);
    if (!measured) return tl::unexpected(measured.error());
    const auto reference = read_rim_table(*task.edge_reference);
    if (!reference) return tl::unexpected(reference.error());
    for (auto& p : measured->points) {
      p.point_mm = task.reference_from_measured * p.point_mm;
      p.normal = task.reference_from_measured.rotation * p.normal;
    }
    auto compared = verify::compare_edge(*measured, *reference);
    if (!compared) return fail(compared.error().code, fmt::format("{}: {}", base::shown(*task.edge), compared.error().message));
    result.edge = *std::move(compared);
  }
  return result;
}

std::vector<base::Verdict> judge(const base::SurfaceVerification& verification, const JobLimits& limits) {
  std::vector<base::Verdict> verdicts;
  // What the points share does not average down: U of such a figure is about that of a single point.
  const auto add = [&](const char* name, double value, double limit, double sigma) {
    base::Verdict verdict{name, value, limit, "mm", fmt::format("limits.{} of the job", name), base::VerdictLevel::kOk};
    verdict.level = base::judge_upper_limit(value, limit, 2.0 * sigma);
    verdicts.push_back(std::move(verdict));
  };
  if (limits.surface_p95_mm && verification.surface) {
    const base::SurfaceDeviations& s = *verification.surface;
    add("surface_p95_mm", s.p95_mm, *limits.surface_p95_mm,
        s.normalised_rms.value_or(0.0) > 0.0 ? s.rms_mm / *s.normalised_rms : 0.0);
  }
  if (limits.edge_rms_mm && verification.edge) {
    const base::EdgeVerification& e = *verification.edge;
    double squares = 0.0;
    for (std::size_t i = 0; i < e.count; ++i)
      squares += 0.5 * (e.sigma_u_mm[i] * e.sigma_u_mm[i] + e.sigma_v_mm[i] * e.sigma_v_mm[i]);
    add("edge_rms_mm", e.rms_mm, *limits.edge_rms_mm,
        std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, e.count))));
  }
  return verdicts;
}

}  // namespace crosstie::app
