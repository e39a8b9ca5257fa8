#include "base/pose.h"

#include <cmath>

#include <fmt/format.h>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace crosstie::base {

Eigen::Matrix4d Pose::matrix() const {
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  result.topLeftCorner<3, 3>() = rotation.toRotationMatrix();
  result.topRightCorner<3, 1>() = translation_mm;
  return result;
}

Matrix6d Pose::adjoint() const {
  const Eigen::Matrix3d r = rotation.toRotationMatrix();
  Matrix6d result = Matrix6d::Zero();
  result.topLeftCorner<3, 3>() = r;
  result.bottomLeftCorner<3, 3>() = skew(translation_mm) * r;
  result.bottomRightCorner<3, 3>() = r;
  return result;
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d result;
  result << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return result;
}

Eigen::Quaterniond rotation_exp(const Eigen::Vector3d& w_rad) {
  const double half = 0.5 * w_rad.norm();
  // sin(half) / (2 half), by its series where the quotient would lose digits.
  const double factor = half < 1e-4 ? 0.5 - half * half / 12.0 : 0.5 * std::sin(half) / half;
  Eigen::Quaterniond result;
  result.w() = std::cos(half);
  result.vec() = factor * w_rad;
  return result.normalized();
}

Eigen::Vector3d rotation_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double w = sign * rotation.w();
  const double sine = v.norm();
  if (sine < 1e-9) return 2.0 / w * v;  // atan(sine / w) / sine = 1 / w to working precision
  return 2.0 * std::atan2(sine, w) / sine * v;
}

Pose perturbed(const Pose& pose, const Vector6d& delta) {
  const Eigen::Quaterniond turn = rotation_exp(delta.head<3>());
  return {(turn * pose.rotation).normalized(), turn * pose.translation_mm + delta.tail<3>()};
}

Vector6d difference(const Pose& from, const Pose& to) {
  const Eigen::Quaterniond turn = (to.rotation * from.rotation.conjugate()).normalized();
  Vector6d delta;
  delta.head<3>() = rotation_log(turn);
  delta.tail<3>() = to.translation_mm - turn * from.translation_mm;
  return delta;
}

Eigen::Matrix3d position_covariance(const Pose& a_from_b, const Matrix6d& covariance) {
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -skew(a_from_b.translation_mm), Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d result = jacobian * covariance * jacobian.transpose();
  return 0.5 * (result + result.transpose());
}

Result<Pose> pose_from_matrix(const Eigen::Matrix4d& a_from_b) {
  constexpr double kTolerance = 1e-6;
  if (!a_from_b.allFinite()) return fail(ErrorCode::kBadInput, "the 4x4 matrix of a pose holds a value that is not finite");
  if ((a_from_b.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > kTolerance) {
    return fail(ErrorCode::kBadInput, "the last row of a pose's 4x4 matrix is not 0 0 0 1; is it written column by column?");
  }
  const Eigen::Matrix3d r = a_from_b.topLeftCorner<3, 3>();
  const double error = (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= kTolerance)) {
    return fail(ErrorCode::kBadInput, fmt::format("the rotation part of a pose's 4x4 matrix is not orthonormal: R^T R differs "
                                                  "from the unit matrix by {:.3g}, allowed is {:.0e}",
                                                  error, kTolerance));
  }
  if (r.determinant() < 0.0) return fail(ErrorCode::kBadInput, "the rotation part of a pose's 4x4 matrix is a reflection");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  return Pose{Eigen::Quaterniond(nearest).normalized(), a_from_b.topRightCorner<3, 1>()};
}

}  // namespace crosstie::base
