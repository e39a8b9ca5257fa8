#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"
#include "math/shape_fit.h"

namespace crosstie::edge {

/// A point of the part that is known in it and was measured in the machine: a marker, or an RPS point.
struct PartPoint {
  int id = 0;
  Eigen::Vector3d p_in_part = Eigen::Vector3d::Zero();
  Eigen::Matrix3d part_cov_mm2 = Eigen::Matrix3d::Zero();  ///< zero: exact, as a drawing is
  Eigen::Vector3d p_in_machine = Eigen::Vector3d::Zero();
  Eigen::Matrix3d machine_cov_mm2 = Eigen::Matrix3d::Zero();
  /// The part's coordinates that count. A marker locks all; the six of a reference point system (RPS) are spread as its drawing
  /// says, 3-2-1 for instance, and the others only show about where the point is.
  std::array<bool, 3> axes = {true, true, true};
};

/// What is left of a point, by the part's axes; zero where an axis does not count.
struct PartResidual {
  int id = 0;
  Eigen::Vector3d residual_mm = Eigen::Vector3d::Zero();  ///< measured, brought into the part, less known
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();     ///< of the residual itself; 0 where nothing checks it
};

/// Where the part lies in the machine.
struct Workpiece {
  std::string source;  ///< "markers", "rps" or "tower"
  base::Pose machine_from_part;
  base::Matrix6d covariance = base::Matrix6d::Zero();  ///< base::Pose's convention; as the given sigmas say
  double sigma0 = 0.0;                                 ///< a posteriori over a priori; 0 without redundancy
  long redundancy = 0;
  std::vector<PartResidual> residuals;  ///< of points, in their order
  double radius_error_mm = 0.0;         ///< of a tower: the hole's distance from the axis less the nominal one
  double radius_sigma_mm = 0.0;
  std::vector<base::Warning> warnings;
};

/// Least squares of the coordinates that count, generalised by the full covariance: `machine_cov_mm2` joint of all measured points, x y
/// z each in their order (what they share of the machine's frame and of stations), in place of their own; empty: independent.
///     min r' Q^-1 r,   r_i = part_from_machine p_i,machine - p_i,part,   Q = R' C_machine R + C_part
/// Start: best fit of all coordinates.
///
/// Errors: kNoUniqueSolution for less than six coordinates or such that leave a direction free, which is named; kBadInput for points
/// twice, values that are not finite, variances that are not positive, and points that are the mirror image of the part's.
/// Warnings: part_point, a point whose coordinates contradict the others (Baarda's test at 0.1 %); the largest first, since one wrong
/// point moves the others, too.
base::Result<Workpiece> workpiece_from_points(std::span<const PartPoint> points, const Eigen::MatrixXd& machine_cov_mm2 = {});

/// A tower's axis and the centre of a hole in its shell.
struct TowerAndHole {
  Eigen::Vector3d axis_point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis_direction = Eigen::Vector3d::UnitZ();  ///< the same end of the tower in part and machine
  Eigen::Vector3d hole_centre_mm = Eigen::Vector3d::Zero();
};

/// Joint covariance of axis point, axis direction and hole's centre.
using TowerCovariance = Eigen::Matrix<double, 9, 9>;

/// Of a fitted cone or cylinder (its quality) whose axis is told by `axis_direction`, along the fitted one or against it, and the
/// centre of a hole, independent of each other.
[[nodiscard]] TowerCovariance tower_covariance(const math::ShapeQuality& axis, const Eigen::Vector3d& axis_direction,
                                               const Eigen::Matrix3d& hole_centre_cov_mm2);

/// The axis of the fitted cone or cylinder is laid onto the part's, the hole gives the place along it and the turn about it; its
/// distance from the axis is a check (the shell's radius is not what holds the part). Six coordinates, six unknowns: no redundancy.
///     machine_from_part = F(machine) F(part)^-1,  F: origin the axis' point nearest to the hole's centre, z along the axis, x to it
/// `covariance` belongs to `in_machine`; `common` is a rigid error of all that was measured in the machine (its frame, the rig), beside
/// it, perturbed on the left as machine_from_part is; it adds as it is.
///
/// Errors: kBadInput for values that are not finite or directions of no length, and for a hole that lies on the axis;
/// kNoUniqueSolution for an axis that is hardly known (a sigma of its direction above a third).
/// Warning: tower_radius, a radius error over its sigma above 3.29.
base::Result<Workpiece> workpiece_from_tower(const TowerAndHole& in_part, const TowerAndHole& in_machine,
                                             const TowerCovariance& covariance,
                                             const base::Matrix6d& common = base::Matrix6d::Zero());

}  // namespace crosstie::edge
