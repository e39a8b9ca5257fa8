#include "registration/detail/shared.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "math/covariance_root.h"

namespace crosstie::registration::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kNoEffect_mm = 1e-5;

}  // namespace

std::optional<Eigen::Matrix3Xd> point_by_head(const base::Head& head, const Eigen::Vector3d& p_in_rig_mm, double left_weight) {
  Eigen::Matrix<double, 2, 3> left_by_point, right_by_point;
  base::ProjectionParameterJacobian left_by_lens, right_by_lens;
  const Eigen::Vector3d p_in_right = head.right_from_left * p_in_rig_mm;
  if (!head.left.project(p_in_rig_mm, &left_by_point, &left_by_lens)) return {};
  if (!head.right.project(p_in_right, &right_by_point, &right_by_lens)) return {};
  // Pixels as observed do not move: A dp + B dtheta = 0 in the weighted least squares.
  const Index left = left_by_lens.cols();
  const Index right = right_by_lens.cols();
  Eigen::Matrix<double, 4, 3> a;
  a.topRows<2>() = left_weight * left_by_point;
  a.bottomRows<2>() = right_by_point * head.right_from_left.rotation.toRotationMatrix();
  MatrixXd b = MatrixXd::Zero(4, left + right + 6);
  b.topLeftCorner(2, left) = left_weight * left_by_lens;
  b.block(2, left, 2, right) = right_by_lens;
  b.block<2, 3>(2, left + right) = -right_by_point * base::skew(p_in_right);
  b.block<2, 3>(2, left + right + 3) = right_by_point;
  return Eigen::Matrix3Xd(-a.colPivHouseholderQr().solve(b));
}

Result<SharedModes> SharedModes::make(const CommissionedHead& commissioned, const std::vector<Eigen::Vector3d>& places) {
  const Index head = commissioned.head.parameter_count();
  const Index frame = commissioned.frame.cov.rows();
  if (commissioned.cov.rows() != head + frame || commissioned.cov.cols() != head + frame || !commissioned.cov.allFinite()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the joint covariance of head and frame is {} x {} and not {} x {}", commissioned.cov.rows(),
                            commissioned.cov.cols(), head + frame, head + frame));
  }
  SharedModes modes;
  modes.commissioned_ = &commissioned;
  const MatrixXd frame_cov = commissioned.cov.bottomRightCorner(frame, frame);
  const MatrixXd mixed = commissioned.cov.topRightCorner(head, frame);
  const math::CovarianceRoot of_frame = math::covariance_root(frame_cov);
  modes.frame_root_ = of_frame.root;
  modes.head_by_frame_ = mixed * of_frame.inverse * of_frame.root;
  const MatrixXd left_over =
      commissioned.cov.topLeftCorner(head, head) - modes.head_by_frame_ * modes.head_by_frame_.transpose();
  const MatrixXd root = math::covariance_root(left_over).root;
  // The combinations that matter: right singular vectors of their effect on the places.
  MatrixXd effect = MatrixXd::Zero(3 * static_cast<Index>(places.size()), root.cols());
  Index seen = 0;
  for (const Eigen::Vector3d& place : places) {
    const auto by_head = point_by_head(commissioned.head, place, 1.0);
    if (by_head) effect.middleRows<3>(3 * seen++) = *by_head * root;
  }
  if (seen == 0 || root.cols() == 0) {
    modes.head_root_ = MatrixXd::Zero(head, 0);
    return modes;
  }
  const MatrixXd gram = effect.topRows(3 * seen).transpose() * effect.topRows(3 * seen) / static_cast<double>(seen);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
  const auto kept = static_cast<Index>((eigen.eigenvalues().array() > kNoEffect_mm * kNoEffect_mm).count());
  modes.head_root_ = root * eigen.eigenvectors().rightCols(kept).rowwise().reverse();
  return modes;
}

Eigen::Matrix3Xd SharedModes::point_by_modes(const Eigen::Vector3d& p_in_rig_mm, double left_weight) const {
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, size());
  const auto by_head = point_by_head(commissioned_->head, p_in_rig_mm, left_weight);
  if (!by_head) return result;
  result.leftCols(frame_size()) = *by_head * head_by_frame_;
  result.rightCols(head_root_.cols()) = *by_head * head_root_;
  return result;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> SharedModes::pose_by_modes(double axis_mm) const {
  Eigen::Matrix<double, 6, Eigen::Dynamic> result = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, size());
  result.leftCols(frame_size()) = commissioned_->frame.jacobian(axis_mm) * frame_root_;
  return result;
}

MatrixXd SharedModes::head_by_modes() const {
  MatrixXd result(head_by_frame_.rows(), size());
  result << head_by_frame_, head_root_;
  return result;
}

}  // namespace crosstie::registration::detail
