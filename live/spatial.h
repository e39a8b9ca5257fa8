#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/observation.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::live {

/// A point of which somebody knows where it is in machine: a marker of the cross.
struct KnownPoint {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();  ///< not used where MachineTie::joint_cov is given
};

/// Where the head is in machine at this moment.
struct MachineTie {
  base::Pose machine_from_rig;
  base::Matrix6d cov = base::Matrix6d::Zero();  ///< [rad, mm]; not used where joint_cov is given
  std::vector<KnownPoint> known = {};           ///< each id once
  /// Joint covariance of the head's parameters (as base::Head::cov), machine_from_rig [rad, mm] and x y z of every known point, in their
  /// order. One commissioning gives all three, and their errors are not independent of each other. Empty: taken as independent, with
  /// the covariances that stand beside them.
  Eigen::MatrixXd joint_cov = {};
};

/// A marker that at least one camera reads.
struct SpatialMarker {
  int id = base::kNoId;
  bool doubtful = false;  ///< a camera is not sure of the id, or sees it twice
  bool left = false;      ///< this camera reads it
  bool right = false;
  /// Middle of its dot, in machine where there is a tie, else in rig; nothing where not both cameras see it once.
  std::optional<Eigen::Vector3d> xyz_mm = {};
  Eigen::Matrix3d image_cov_mm2 = Eigen::Matrix3d::Zero();  ///< of the noise in both images
  Eigen::Matrix3d calibration_cov_mm2 =
      Eigen::Matrix3d::Zero();  ///< of the head and of its place in machine, common to all markers
  /// Misfit of both images to one point, signed, over its sigma: the distance from the epipolar curve. Standard normal where the head is
  /// as it was calibrated.
  std::optional<double> epipolar_w = {};
  /// Difference from the known point over its sigma, sqrt(d' C^-1 d / 3); its square is chi-square over 3 degrees of freedom.
  std::optional<double> known_w = {};

  [[nodiscard]] Eigen::Matrix3d cov_mm2() const { return image_cov_mm2 + calibration_cov_mm2; }
  /// What is shown: the larger one of both.
  [[nodiscard]] std::optional<double> w() const;
};

/// The markers that the cameras of a head read in one pair of images, by id.
///
/// Both images are reduced from the ellipses' centres to those of the circles (math::circle_of_pair), the point is triangulated under the
/// observations' covariances (math::triangulate), and their misfit, one degree of freedom, is standardised: to first order
///
///     misfit = n' W (measured - f(X, head)),   n the unit vector that the whitened derivatives by X leave,   variance 1 + g C g',
///
/// with g the derivative by the head's parameters and C their covariance. The covariance by calibration follows from the same derivatives.
/// A head without covariance is taken as exact. Observations of ids in use only (coded), and those that are doubtful (ambiguous); refused
/// and unread ones are left out. Observations without a positive definite covariance are seen and not triangulated.
///
/// Errors: kUsage for a tie with an id twice or a joint covariance of another size.
[[nodiscard]] base::Result<std::vector<SpatialMarker>> locate_markers(const base::Head& head,
                                                                      const base::ImageObservations& left,
                                                                      const base::ImageObservations& right,
                                                                      const std::optional<MachineTie>& tie = {});

}  // namespace crosstie::live
