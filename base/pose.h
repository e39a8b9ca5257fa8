#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/result.h"

namespace crosstie::base {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A rigid motion `a_from_b`: p_in_a = rotation * p_in_b + translation_mm. The name of a variable says its direction.
///
/// Its covariance is 6x6 in the order [rotation rad, translation mm] for a perturbation on the left:
///     true = exp(w, v) * estimate:   R = exp(w^) R0,   t = exp(w^) t0 + v,   Cov([w, v]).
/// So cov(a_from_c) = cov(a_from_b) + Ad(a_from_b) cov(b_from_c) Ad(a_from_b)^T for independent factors
/// (Barfoot & Furgale, IEEE Trans. Robotics 30(3), 2014, to first order).
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

  /// a_from_b * p_in_b = p_in_a.
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& p_in_b) const { return rotation * p_in_b + translation_mm; }
  /// a_from_b * b_from_c = a_from_c.
  [[nodiscard]] Pose operator*(const Pose& b_from_c) const {
    return {(rotation * b_from_c.rotation).normalized(), *this * b_from_c.translation_mm};
  }
  [[nodiscard]] Pose inverse() const {
    const Eigen::Quaterniond back = rotation.conjugate();
    return {back, -(back * translation_mm)};
  }
  [[nodiscard]] Eigen::Matrix4d matrix() const;
  /// Ad with a_from_b * exp(d) = exp(Ad d) * a_from_b, d = [rotation, translation].
  [[nodiscard]] Matrix6d adjoint() const;
};

/// The 3x3 matrix with skew(a) * b = a x b.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// The rotation about `w_rad` by its length.
[[nodiscard]] Eigen::Quaterniond rotation_exp(const Eigen::Vector3d& w_rad);

/// The inverse of rotation_exp; the length is at most pi.
[[nodiscard]] Eigen::Vector3d rotation_log(const Eigen::Quaterniond& rotation);

/// exp(w, v) * pose, the perturbation in which covariances are written; delta = [w rad, v mm].
[[nodiscard]] Pose perturbed(const Pose& pose, const Vector6d& delta);

/// The delta with perturbed(from, delta) = to.
[[nodiscard]] Vector6d difference(const Pose& from, const Pose& to);

/// Covariance in mm^2 of a_from_b.translation_mm (for network_from_camera: of the projection centre) from that of the pose.
[[nodiscard]] Eigen::Matrix3d position_covariance(const Pose& a_from_b, const Matrix6d& covariance);

/// Reads a rigid 4x4 matrix; an Error where its rotation part is not orthonormal to 1e-6 or is left-handed.
[[nodiscard]] Result<Pose> pose_from_matrix(const Eigen::Matrix4d& a_from_b);

}  // namespace crosstie::base
