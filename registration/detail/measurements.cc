#include "registration/detail/measurements.h"

#include <Eigen/Geometry>

namespace crosstie::registration::detail {
namespace {

using base::Matrix6d;
using base::Pose;
using base::skew;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMajor = math::WhitenedRows::Matrix;

bool wanted(double* const* jacobians, std::size_t block) { return jacobians != nullptr && jacobians[block] != nullptr; }

}  // namespace

bool MarkerSighting::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Pose pose = math::pose_from_values(values[0]);
  const Eigen::Map<const Vector3d> point(values[1]);
  const Matrix3d back = pose.rotation.toRotationMatrix().transpose();
  Vector3d difference = back * (point - pose.translation_mm) - p_in_rig_mm_;
  if (by_shared_.cols() > 0) difference -= by_shared_ * Eigen::Map<const Eigen::VectorXd>(values[2], by_shared_.cols());
  Eigen::Map<Vector3d>(residual, 3) = whitening_ * difference;
  const Matrix3d turned = whitening_ * back;
  if (wanted(jacobians, 0)) {
    Eigen::Map<RowMajor> by_pose(jacobians[0], 3, 6);
    by_pose.leftCols<3>() = turned * skew(point);
    by_pose.rightCols<3>() = -turned;
  }
  if (wanted(jacobians, 1)) Eigen::Map<RowMajor>(jacobians[1], 3, 3) = turned;
  if (by_shared_.cols() > 0 && wanted(jacobians, 2)) {
    Eigen::Map<RowMajor>(jacobians[2], 3, by_shared_.cols()) = -whitening_ * by_shared_;
  }
  return true;
}

bool ListedMarkers::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const std::size_t count = static_cast<std::size_t>(listed_mm_.size()) / 3;
  const Pose machine_from_part = own_frame_ ? math::pose_from_values(values[count]) : Pose{};
  const Matrix3d back = machine_from_part.rotation.toRotationMatrix().transpose();
  Eigen::VectorXd difference = -listed_mm_;
  Eigen::MatrixXd by_part = Eigen::MatrixXd::Zero(listed_mm_.size(), own_frame_ ? 6 : 0);
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = 3 * static_cast<Index>(i);
    const Eigen::Map<const Vector3d> point(values[i]);
    difference.segment<3>(at) += back * (point - machine_from_part.translation_mm);
    if (wanted(jacobians, i)) Eigen::Map<RowMajor>(jacobians[i], rows(), 3) = whitening_.middleCols<3>(at) * back;
    if (own_frame_) by_part.middleRows<3>(at) << back * skew(point), -back;
  }
  Eigen::Map<Eigen::VectorXd>(residual, rows()) = whitening_ * difference;
  if (own_frame_ && wanted(jacobians, count)) Eigen::Map<RowMajor>(jacobians[count], rows(), 6) = whitening_ * by_part;
  return true;
}

bool AxisStop::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const base::Vector6d off = base::difference(at_, math::pose_from_values(values[0]));
  const Eigen::Map<const Eigen::VectorXd> shared(values[1], by_shared_.cols());
  Eigen::Map<base::Vector6d>(residual, 6) = whitening_ * (off - by_shared_ * shared);
  if (wanted(jacobians, 0)) {
    // exp(d) exp(off): rotations to first order of the small off, translations exactly.
    Matrix6d by_pose = Matrix6d::Identity();
    by_pose.topLeftCorner<3, 3>() -= 0.5 * skew(off.head<3>());
    by_pose.bottomLeftCorner<3, 3>() = -skew(off.tail<3>());
    Eigen::Map<RowMajor>(jacobians[0], 6, 6) = whitening_ * by_pose;
  }
  if (wanted(jacobians, 1)) Eigen::Map<RowMajor>(jacobians[1], 6, by_shared_.cols()) = -whitening_ * by_shared_;
  return true;
}

bool OverlapFactor::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Index shared = root_.cols() - 6;
  Eigen::VectorXd all = offset_;
  if (shared > 0) all += root_.rightCols(shared) * Eigen::Map<const Eigen::VectorXd>(values[2], shared);
  Eigen::Map<Eigen::VectorXd>(residual, rows()) = all;
  if (wanted(jacobians, 0)) Eigen::Map<RowMajor>(jacobians[0], rows(), 6) = root_.leftCols<6>();
  if (wanted(jacobians, 1)) Eigen::Map<RowMajor>(jacobians[1], rows(), 6) = -root_.leftCols<6>();
  if (shared > 0 && wanted(jacobians, 2)) Eigen::Map<RowMajor>(jacobians[2], rows(), shared) = root_.rightCols(shared);
  return true;
}

}  // namespace crosstie::registration::detail
