#include "app/measured_part.h"

#include <algorithm>

#include <fmt/core.h>

#include "base/file.h"
#include "base/ply.h"
#include "verify/surface.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

/// The motion that all stations have in common: the mean of their perturbations.
base::Matrix6d common_motion(const base::Stitching& stitching) {
  base::Matrix6d common = base::Matrix6d::Zero();
  const auto count = static_cast<Eigen::Index>(stitching.stations.size());
  if (stitching.covariance.rows() < 6 * count) return common;
  for (Eigen::Index a = 0; a < count; ++a) {
    for (Eigen::Index b = 0; b < count; ++b) common += stitching.covariance.block<6, 6>(6 * a, 6 * b);
  }
  return common / static_cast<double>(count * count);
}

Eigen::Matrix<double, 3, 6> by_motion(const Eigen::Vector3d& point_mm) {
  Eigen::Matrix<double, 3, 6> rows;
  rows << -base::skew(point_mm), Eigen::Matrix3d::Identity();
  return rows;
}

/// What is left of a covariance without the part that is shared: its diagonal, at least a hundredth of what it was.
Eigen::Matrix3d own_part(const Eigen::Matrix3d& cov_mm2, const Eigen::Matrix3d& shared_mm2) {
  return (cov_mm2 - shared_mm2).diagonal().cwiseMax(0.01 * cov_mm2.diagonal()).asDiagonal();
}

/// The markers, what they share taken as the stations' common motion.
void take_markers(const base::Stitching& stitching, MeasuredPart& part) {
  const auto count = static_cast<Eigen::Index>(stitching.markers.size());
  Eigen::MatrixXd by_common(3 * count, 6);
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(3 * count, 3 * count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const base::StitchedMarker& marker = stitching.markers[static_cast<std::size_t>(i)];
    part.markers.points.push_back({.id = marker.id, .xyz_mm = marker.xyz_mm, .cov_mm2 = marker.cov_mm2});
    by_common.middleRows<3>(3 * i) = by_motion(marker.xyz_mm);
    const Eigen::Matrix<double, 3, 6> rows = by_common.middleRows<3>(3 * i);
    own.block<3, 3>(3 * i, 3 * i) = own_part(marker.cov_mm2, rows * part.common * rows.transpose());
  }
  if (count > 0) part.markers_cov_mm2 = own + by_common * part.common * by_common.transpose();
}

/// The tower's shell through the stitched cloud.
Result<> fit_tower(const Job& job, const std::filesystem::path& file, MeasuredPart& part) {
  const auto cloud = base::read_ply(file);
  if (!cloud) return tl::unexpected(cloud.error());
  const auto shell = verify::fit_shell(*cloud, {.cone = job.part.half_angle_rad != 0.0});
  if (!shell) return fail(shell.error().code, fmt::format("{}: {}", base::shown(file), shell.error().message));
  part.axis_point_mm = shell->point_mm;
  part.axis_direction = shell->direction;
  part.axis = shell->quality;
  return {};
}

}  // namespace

Result<MeasuredPart> measured_part(const Job& job, const base::Stitching& stitching, const std::filesystem::path& cloud,
                                   const std::optional<edge::NominalFit>& fit, const Eigen::Vector3d& hole_in_nominal) {
  MeasuredPart part;
  part.common = common_motion(stitching);
  take_markers(stitching, part);
  part.tied_by_stitch = stitching.machine_from_part;
  part.tied_cov = stitching.machine_from_part_cov;
  if (job.part.position != "tower") return part;
  if (auto fitted = fit_tower(job, cloud, part); !fitted) return fail(std::move(fitted));
  if (!fit)
    return fail(ErrorCode::kBadInput, "position = \"tower\": the nominal hole could not be fitted to the measured edge");
  part.hole_centre_mm = fit->frame_from_hole * hole_in_nominal;
  const Eigen::Matrix<double, 3, 6> by_pose = by_motion(part.hole_centre_mm);
  part.hole_centre_cov_mm2 = own_part(by_pose * fit->covariance.topLeftCorner<6, 6>() * by_pose.transpose(),
                                      by_pose * part.common * by_pose.transpose());
  return part;
}

}  // namespace crosstie::app
