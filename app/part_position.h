#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "app/job.h"
#include "base/point_list.h"
#include "base/pose.h"
#include "base/result.h"
#include "edge/workpiece.h"
#include "math/shape_fit.h"

namespace crosstie::app {

/// What was measured in the machine that may tell where the part lies.
struct MeasuredPart {
  base::PointList markers;               ///< position = "markers" without a file: as the stations saw them
  Eigen::MatrixXd markers_cov_mm2 = {};  ///< joint, in the list's order; empty: each with its own
  /// position = "tower": the fitted shell's axis and its quality, and the hole's centre with its covariance.
  Eigen::Vector3d axis_point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis_direction = Eigen::Vector3d::Zero();  ///< of a cone to where it widens; zero: no shell was fitted
  math::ShapeQuality axis = {};
  Eigen::Vector3d hole_centre_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d hole_centre_cov_mm2 = Eigen::Matrix3d::Zero();
  /// position = "markers" without points: where stitch found the list of markers round the hole.
  std::optional<base::Pose> tied_by_stitch = {};
  base::Matrix6d tied_cov = base::Matrix6d::Zero();
  base::Matrix6d common = base::Matrix6d::Zero();  ///< error of the machine's frame that all of it shares
};

/// machine_from_part as [part] position says; the identity without a sigma for "none". `hole_in_part` is the nominal centre of the hole,
/// needed for "tower". Which end of the fitted axis is which
/// follows from [part] axis_in_machine, else from where the cone widens.
///
/// Errors: kBadInput where what the position needs was not measured; those of reading the lists and of edge/workpiece.h.
base::Result<edge::Workpiece> part_position(const Job& job, const MeasuredPart& measured,
                                            const std::optional<Eigen::Vector3d>& hole_in_part);

/// The files that [part] names, resolved, sorted.
[[nodiscard]] std::vector<std::filesystem::path> part_files(const Job& job);

}  // namespace crosstie::app
