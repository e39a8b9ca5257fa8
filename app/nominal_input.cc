#include "app/nominal_input.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "edge/nominal_file.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;
using edge::Nominal;
using edge::NominalKind;

constexpr double kOnShell = 0.01;  // of the radius
constexpr double kSquareToShell_rad = 0.1;

/// The tower of [part] at a point of its shell.
struct Shell {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double radius_mm = 0.0;                                ///< drawn, across the axis, at the point's height
  double distance_mm = 0.0;                              ///< of the point from the axis
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();     ///< towards the head
  Eigen::Vector3d generator = Eigen::Vector3d::UnitX();  ///< along the shell, to where it widens
};

std::optional<Shell> shell_at(const JobPart& part, const Eigen::Vector3d& p) {
  if (!part.axis_point_mm || !part.radius_mm) return std::nullopt;
  Shell shell;
  shell.axis = part.axis_direction->normalized();
  const Eigen::Vector3d from_axis = p - *part.axis_point_mm;
  const double along = shell.axis.dot(from_axis);
  const Eigen::Vector3d across = from_axis - along * shell.axis;
  shell.distance_mm = across.norm();
  shell.radius_mm = *part.radius_mm + along * std::tan(part.half_angle_rad);
  const Eigen::Vector3d radial = across / std::max(shell.distance_mm, 1e-9);
  const double c = std::cos(part.half_angle_rad);
  const double s = std::sin(part.half_angle_rad);
  shell.normal = (part.seen_from_inside ? -1.0 : 1.0) * (c * radial - s * shell.axis);
  shell.generator = c * shell.axis + s * radial;
  return shell;
}

Result<> place_outline(const Job& job, NominalInput& input) {
  const JobHole& hole = *job.hole;
  const auto bad = [&](const std::string& what) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}: [hole] {}", job.file.string(), what));
  };
  Eigen::Vector3d z = hole.normal->normalized();
  Eigen::Vector3d centre = *hole.centre_mm;
  const auto shell = hole.nominal_frame == "part" ? shell_at(job.part, centre) : std::nullopt;
  if (shell) {
    if (!(shell->radius_mm > 0.0) || std::abs(shell->distance_mm - shell->radius_mm) > kOnShell * shell->radius_mm) {
      return bad(fmt::format(
          "centre_mm is {:.1f} mm from the tower's axis, and its shell there {:.1f} mm: the centre lies on the shell",
          shell->distance_mm, shell->radius_mm));
    }
    const double off = std::acos(std::clamp(shell->normal.dot(z), -1.0, 1.0));
    if (off > kSquareToShell_rad) {
      return bad(fmt::format(
          "normal is {:.3f} rad off the tower's normal towards the head (head = \"{}\"); the prism of the hole is cut "
          "square to the shell",
          off, job.part.seen_from_inside ? "inside" : "outside"));
    }
    z = shell->normal;
    centre += (shell->radius_mm - shell->distance_mm) *
              (centre - *job.part.axis_point_mm - shell->axis.dot(centre - *job.part.axis_point_mm) * shell->axis).normalized();
  }
  Eigen::Vector3d x = hole.direction.value_or(shell ? shell->generator : z.unitOrthogonal());
  x -= x.dot(z) * z;
  if (!(x.norm() > 1e-6)) return bad("length_direction is along the normal");
  Eigen::Matrix3d axes;
  axes.col(0) = x.normalized();
  axes.col(1) = z.cross(axes.col(0));
  axes.col(2) = z;
  input.frame_from_hole = base::Pose{Eigen::Quaterniond(axes).normalized(), centre};
  if (shell) {
    edge::Saddle saddle;
    saddle.radius_mm = (job.part.seen_from_inside ? -1.0 : 1.0) * shell->radius_mm;
    saddle.half_angle_rad = job.part.half_angle_rad;
    saddle.direction_rad = std::atan2(shell->generator.dot(axes.col(1)), shell->generator.dot(axes.col(0)));
    input.nominal.saddle = saddle;
  }
  return {};
}

}  // namespace

Result<NominalInput> nominal_input(const Job& job) {
  if (!job.hole || job.hole->nominal.empty()) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}: the job has no [hole] nominal", job.file.string()));
  }
  const JobHole& hole = *job.hole;
  NominalInput input;
  input.frame = hole.nominal_frame;
  if (const auto kind = edge::outline_of(hole.nominal)) {
    input.nominal.kind = *kind;
    input.nominal.exponent = hole.exponent;
    if (hole.diameter_mm) input.nominal.size_mm = {*hole.diameter_mm};
    if (hole.length_mm) input.nominal.size_mm = {*hole.length_mm, *hole.width_mm};
    if (hole.centre_mm) {
      if (auto placed = place_outline(job, input); !placed) return base::fail(std::move(placed));
    }
    if (!input.nominal.size_mm.empty()) {
      if (auto good = edge::NominalCurve::make(input.nominal); !good) {
        return base::fail(good.error().code, fmt::format("{}: [hole] {}", job.file.string(), good.error().message));
      }
    }
    return input;
  }
  input.file = job.resolve(hole.nominal);
  auto list = edge::read_nominal(*input.file, {hole.unit, hole.closed, hole.spline});
  if (!list) return base::fail(std::move(list));
  input.nominal = *std::move(list);
  input.frame_from_hole = base::Pose{};
  if (input.nominal.normals.empty() && hole.nominal_frame == "part" && job.part.axis_point_mm && job.part.radius_mm) {
    for (const Eigen::Vector3d& p : input.nominal.points_mm) input.nominal.normals.push_back(shell_at(job.part, p)->normal);
  }
  return input;
}

Result<Nominal> nominal_of(const std::string& word_or_file, const std::string& unit) {
  Nominal nominal;
  if (const auto kind = edge::outline_of(word_or_file)) {
    nominal.kind = *kind;
    return nominal;
  }
  return edge::read_nominal(word_or_file, {.unit = unit});
}

}  // namespace crosstie::app
