#include "app/part_position.h"

#include <fmt/core.h>

#include "base/file.h"
#include "base/table.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using edge::PartPoint;
using edge::Workpiece;

/// The column `axes` of a list, by id; all axes where there is none.
Result<std::vector<std::pair<int, std::array<bool, 3>>>> locked_axes(const std::filesystem::path& file) {
  std::vector<std::pair<int, std::array<bool, 3>>> locked;
  const auto table = base::read_table(file);
  if (!table) return locked;  // an object list
  const auto id = table->column("id");
  const auto axes = table->column("axes");
  if (!id || !axes) return locked;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto number = table->integer(row, *id);
    if (!number) return tl::unexpected(number.error());
    const std::string& word = table->rows[row][*axes];
    if (word.find_first_not_of("xyz") != std::string::npos) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{}:{}: axes are of x, y and z, not '{}'", base::shown(file), table->lines[row], word));
    }
    locked.emplace_back(*number, std::array<bool, 3>{word.find('x') != std::string::npos, word.find('y') != std::string::npos,
                                                     word.find('z') != std::string::npos});
  }
  return locked;
}

Result<Workpiece> from_points(const Job& job, const MeasuredPart& measured) {
  const std::filesystem::path known_file = job.resolve(*job.part.points);
  const auto known = base::read_point_list(known_file);
  if (!known) return tl::unexpected(known.error());
  const auto axes = locked_axes(known_file);
  if (!axes) return tl::unexpected(axes.error());
  base::PointList seen = measured.markers;
  Eigen::MatrixXd joint = measured.markers_cov_mm2;
  if (job.part.measured) {
    auto list = base::read_point_list(job.resolve(*job.part.measured));
    if (!list) return base::fail(std::move(list));
    seen = *std::move(list);
    joint.resize(0, 0);
  }
  std::vector<PartPoint> points;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const base::ReferencePoint* partner = known->find(seen.points[i].id);
    if (partner == nullptr) continue;
    PartPoint p;
    p.id = partner->id;
    p.p_in_part = partner->xyz_mm;
    p.part_cov_mm2 = partner->cov_mm2.value_or(Eigen::Matrix3d::Zero());
    p.p_in_machine = seen.points[i].xyz_mm;
    p.machine_cov_mm2 = seen.points[i].cov_mm2.value_or(Eigen::Matrix3d::Zero());
    for (const auto& [id, which] : *axes) {
      if (id == p.id) p.axes = which;
    }
    for (int axis = 0; axis < 3; ++axis) rows.push_back(static_cast<Eigen::Index>(3 * i) + axis);
    points.push_back(p);
  }
  if (points.empty()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("none of the part's points in {} was measured in the machine", base::shown(known_file)));
  }
  const Eigen::MatrixXd of_them = joint.size() > 0 ? Eigen::MatrixXd(joint(rows, rows)) : Eigen::MatrixXd();
  auto part = edge::workpiece_from_points(points, of_them);
  if (!part) return fail(part.error().code, fmt::format("{}: {}", base::shown(known_file), part.error().message));
  return part;
}

Result<Workpiece> from_stitch(const Job& job, const MeasuredPart& measured) {
  if (!measured.tied_by_stitch) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("{}: [part] position = \"markers\" without points needs [hole] markers in the part's frame, and stitch did "
                    "not find where they lie in the machine",
                    job.file.string()));
  }
  Workpiece part;
  part.source = "markers";
  part.machine_from_part = *measured.tied_by_stitch;
  part.covariance = measured.tied_cov;
  return part;
}

Result<Workpiece> from_tower(const Job& job, const MeasuredPart& measured, const std::optional<Eigen::Vector3d>& hole_in_part) {
  if (!hole_in_part) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: [part] position = \"tower\" needs the nominal hole's centre in the part: [hole] centre_mm",
                            job.file.string()));
  }
  if (measured.axis_direction.isZero(0.0)) {
    return fail(ErrorCode::kBadInput, "position = \"tower\": no cone or cylinder could be fitted to the stitched cloud");
  }
  const edge::TowerAndHole drawn{*job.part.axis_point_mm, *job.part.axis_direction, *hole_in_part};
  double sense = job.part.half_angle_rad < 0.0 ? -1.0 : 1.0;  // both widen along their direction, a drawn one may narrow
  if (job.part.axis_in_machine) sense = measured.axis_direction.dot(*job.part.axis_in_machine) < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d direction = sense * measured.axis_direction;
  return edge::workpiece_from_tower(drawn, {measured.axis_point_mm, direction, measured.hole_centre_mm},
                                    edge::tower_covariance(measured.axis, direction, measured.hole_centre_cov_mm2),
                                    measured.common);
}

}  // namespace

Result<Workpiece> part_position(const Job& job, const MeasuredPart& measured,
                                const std::optional<Eigen::Vector3d>& hole_in_part) {
  if (job.part.position == "markers" && !job.part.points) return from_stitch(job, measured);
  if (job.part.position == "markers" || job.part.position == "rps") return from_points(job, measured);
  if (job.part.position == "tower") return from_tower(job, measured, hole_in_part);
  Workpiece same;
  same.source = "none";
  return same;
}

std::vector<std::filesystem::path> part_files(const Job& job) {
  std::vector<std::filesystem::path> files;
  for (const auto& file : {job.part.points, job.part.measured}) {
    if (file) files.push_back(job.resolve(*file));
  }
  return files;
}

}  // namespace crosstie::app
