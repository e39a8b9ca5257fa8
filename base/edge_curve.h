#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace crosstie::base {

/// A point of a hole's rim: where the surface on the material side ends.
struct EdgePoint {
  double s_mm = 0.0;                                   ///< arc length from the first point
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< in the curve's frame
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< of the surface on the material side, towards the head; unit length
  Eigen::Vector3d tangent = Eigen::Vector3d::Zero();   ///< along growing s; across it and the normal: u = normal x tangent
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();   ///< of this point alone, independent of the others
  double sigma_u_mm = 0.0;                             ///< in the surface across the rim, all parts together
  double sigma_v_mm = 0.0;                             ///< along the normal, all parts together
  /// Of the normal's tilts towards u and towards the tangent, of this point alone; see EdgeCurve::depths_mm.
  Eigen::Vector2d tilt_variance_rad2 = Eigen::Vector2d::Zero();
  Eigen::Vector2d sigma_tilt_rad = Eigen::Vector2d::Zero();  ///< of them, all parts together
  std::vector<int> stations = {};                            ///< indices into EdgeCurve::stations, of those that saw it
};

/// A part of the rim that no station saw, or that what was seen contradicts; never bridged.
struct EdgeGap {
  double from_mm = 0.0;  ///< arc length at which it begins; its own length is that of the chord
  double length_mm = 0.0;
  std::string reason;
};

/// The rim of a hole, its points in order.
struct EdgeCurve {
  std::string frame;  ///< "rig" (one station) or "machine"
  std::vector<std::string> stations;
  std::vector<EdgePoint> points;
  bool closed = false;  ///< the last point is followed by the first
  double length_mm = 0.0;
  std::vector<EdgeGap> gaps;
  /// What the points share (calibration, poses of the stations): their joint error is shared_mm * z with z of unit variance, beside
  /// that of each point alone. x y z of each point, as many columns as there are shared causes.
  Eigen::MatrixXd shared_mm = {};
  /// The same of the normals' tilts: towards u, towards the tangent of each point. Empty: they share nothing.
  Eigen::MatrixXd shared_tilt_rad = {};
  /// Length of rim before which the depths lie that tell a point's normal: points nearer to each other have depths in common, and the
  /// correlation of their own tilts falls linearly to none at this distance.
  double depths_mm = 0.0;
};

}  // namespace crosstie::base
