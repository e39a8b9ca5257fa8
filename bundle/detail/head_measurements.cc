#include "bundle/detail/head_measurements.h"

#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "base/machine.h"

namespace crosstie::bundle::detail {
namespace {

using base::Matrix6d;
using base::Pose;
using base::skew;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMajor = math::WhitenedRows::Matrix;

constexpr double kSmall_rad = 1e-3;  // below, series to the fourth power are exact to rounding

/// exp(J w') about exp(w): exp(w + w') = exp(J w') exp(w).
Matrix3d left_jacobian(const Vector3d& w) {
  const double angle = w.norm();
  const double square = angle * angle;
  const double a = angle < kSmall_rad ? 0.5 - square / 24.0 : (1.0 - std::cos(angle)) / square;
  const double b = angle < kSmall_rad ? 1.0 / 6.0 - square / 120.0 : (angle - std::sin(angle)) / (square * angle);
  return Matrix3d::Identity() + a * skew(w) + b * skew(w) * skew(w);
}

Matrix3d inverse_left_jacobian(const Vector3d& w) {
  const double angle = w.norm();
  const double c = angle < kSmall_rad ? 1.0 / 12.0 + angle * angle / 720.0
                                      : 1.0 / (angle * angle) - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle));
  return Matrix3d::Identity() - 0.5 * skew(w) + c * skew(w) * skew(w);
}

bool wanted(double* const* jacobians, std::size_t block) { return jacobians != nullptr && jacobians[block] != nullptr; }

std::vector<int> with(std::vector<int> blocks, int last) {
  blocks.push_back(last);
  return blocks;
}

}  // namespace

DifferenceJacobians difference_jacobians(const base::Vector6d& difference) {
  const Vector3d w = difference.head<3>();
  DifferenceJacobians result;
  result.by_to = Matrix6d::Identity();
  result.by_to.topLeftCorner<3, 3>() = inverse_left_jacobian(w);
  result.by_to.bottomLeftCorner<3, 3>() = -skew(difference.tail<3>());
  result.by_from = Matrix6d::Zero();
  result.by_from.topLeftCorner<3, 3>() = -inverse_left_jacobian(-w);
  result.by_from.bottomRightCorner<3, 3>() = -base::rotation_exp(w).toRotationMatrix();
  return result;
}

Matrix6d at_origin(const Vector3d& origin_mm) {
  Matrix6d result = Matrix6d::Identity();
  result.bottomLeftCorner<3, 3>() = -skew(origin_mm);
  return result;
}

HeadPrior::HeadPrior(std::vector<int> blocks, Eigen::VectorXd left, Eigen::VectorXd right, const Pose& rig_from_right,
                     Eigen::MatrixXd whitening)
    : Measurement(std::move(blocks)),
      left_(std::move(left)),
      right_(std::move(right)),
      rig_from_right_(rig_from_right),
      whitening_(std::move(whitening)) {}

bool HeadPrior::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Eigen::Index l = left_.size();
  const Eigen::Index r = right_.size();
  const base::Vector6d pose = base::difference(rig_from_right_, math::pose_from_values(values[2]));
  Eigen::VectorXd all(l + r + 6);
  all << Eigen::Map<const Eigen::VectorXd>(values[0], l) - left_, Eigen::Map<const Eigen::VectorXd>(values[1], r) - right_,
      pose;
  Eigen::Map<Eigen::VectorXd>(residual, rows()) = whitening_ * all;
  if (wanted(jacobians, 0)) Eigen::Map<RowMajor>(jacobians[0], rows(), l) = whitening_.leftCols(l);
  if (wanted(jacobians, 1)) Eigen::Map<RowMajor>(jacobians[1], rows(), r) = whitening_.middleCols(l, r);
  if (wanted(jacobians, 2)) {
    Eigen::Map<RowMajor>(jacobians[2], rows(), 6) = whitening_.rightCols<6>() * difference_jacobians(pose).by_to;
  }
  return true;
}

ListedPoints::ListedPoints(std::vector<int> points, int growth, Eigen::VectorXd listed_mm, Eigen::MatrixXd whitening)
    : Measurement(with(std::move(points), growth)), listed_mm_(std::move(listed_mm)), whitening_(std::move(whitening)) {}

bool ListedPoints::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const std::size_t points = blocks().size() - 1;
  Eigen::VectorXd difference = -(1.0 + 1e-6 * values[points][0]) * listed_mm_;
  for (std::size_t i = 0; i < points; ++i) {
    difference.segment<3>(3 * static_cast<Eigen::Index>(i)) += Eigen::Map<const Vector3d>(values[i]);
    if (wanted(jacobians, i)) {
      Eigen::Map<RowMajor>(jacobians[i], rows(), 3) = whitening_.middleCols<3>(3 * static_cast<Eigen::Index>(i));
    }
  }
  Eigen::Map<Eigen::VectorXd>(residual, rows()) = whitening_ * difference;
  if (wanted(jacobians, points)) Eigen::Map<Eigen::VectorXd>(jacobians[points], rows()) = -1e-6 * (whitening_ * listed_mm_);
  return true;
}

ProbedCentre::ProbedCentre(int machine_from_cross, int point, const Vector3d& probed_mm, Eigen::MatrixXd whitening)
    : Measurement({machine_from_cross, point}), probed_mm_(probed_mm), whitening_(std::move(whitening)) {}

bool ProbedCentre::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const Pose machine_from_cross = math::pose_from_values(values[0]);
  const Vector3d p_in_machine = machine_from_cross * Eigen::Map<const Vector3d>(values[1]);
  Eigen::Map<Eigen::VectorXd>(residual, rows()) = whitening_ * (p_in_machine - probed_mm_);
  if (wanted(jacobians, 0)) {
    Eigen::Map<RowMajor> by_pose(jacobians[0], rows(), 6);
    by_pose.leftCols<3>() = -whitening_ * skew(p_in_machine);
    by_pose.rightCols<3>() = whitening_;
  }
  if (wanted(jacobians, 1)) {
    Eigen::Map<RowMajor>(jacobians[1], rows(), 3) = whitening_ * machine_from_cross.rotation.toRotationMatrix();
  }
  return true;
}

Pose carried(const Carriage& carriage, double axis_mm, const double* const* values, Eigen::MatrixXd* jacobian) {
  const Pose at_middle = math::pose_from_values(values[0]);
  const double t = carriage.place(axis_mm);
  const double way = axis_mm - carriage.middle_mm;
  const double stretch = 1.0 + 1e-6 * values[2][0];
  const Vector3d direction = carriage.direction_at(values[1]);
  Vector3d shift = direction * (way * stretch);
  Vector3d turn = Vector3d::Zero();
  for (std::size_t i = 0; i < carriage.terms.size(); ++i) {
    const AxisTerm& term = carriage.terms[i];
    (term.angle ? turn : shift)(term.component) += values[3][i] * base::legendre(term.order, t);
  }
  const Eigen::Quaterniond rotation = base::rotation_exp(turn);
  const Pose motion{rotation, shift + carriage.pivot_mm - rotation * carriage.pivot_mm};
  if (jacobian != nullptr) {
    *jacobian = Eigen::MatrixXd::Zero(6, 9 + static_cast<Eigen::Index>(carriage.terms.size()));
    jacobian->leftCols<6>() = motion.adjoint();
    const Vector3d raw = carriage.direction + carriage.across * Eigen::Vector2d(values[1][0], values[1][1]);
    const Matrix3d normalised = (Matrix3d::Identity() - direction * direction.transpose()) / raw.norm();
    jacobian->block<3, 2>(3, 6) = normalised * carriage.across * (way * stretch);
    jacobian->block<3, 1>(3, 8) = direction * (1e-6 * way);
    const Matrix3d left = left_jacobian(turn);
    const Vector3d pivot = carriage.pivot_mm + shift;
    for (std::size_t i = 0; i < carriage.terms.size(); ++i) {
      const AxisTerm& term = carriage.terms[i];
      const double value = base::legendre(term.order, t);
      const auto column = 9 + static_cast<Eigen::Index>(i);
      if (term.angle) {
        const Vector3d w = left.col(term.component) * value;
        jacobian->block<3, 1>(0, column) = w;
        jacobian->block<3, 1>(3, column) = pivot.cross(w);
      } else {
        (*jacobian)(3 + term.component, column) = value;
      }
    }
  }
  return motion * at_middle;
}

bool OnAxis::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  Eigen::MatrixXd by_carriage;
  const Pose from = carried(carriage_, axis_mm_, values + 2, jacobians != nullptr ? &by_carriage : nullptr);
  const Pose machine_from_cross = math::pose_from_values(values[0]);
  const base::Vector6d difference = base::difference(from, machine_from_cross * math::pose_from_values(values[1]));
  Eigen::Map<base::Vector6d>(residual, 6) = whitening_ * difference;
  if (jacobians == nullptr) return true;
  const DifferenceJacobians by = difference_jacobians(difference);
  const Matrix6d by_to = whitening_ * by.by_to;
  if (wanted(jacobians, 0)) Eigen::Map<RowMajor>(jacobians[0], 6, 6) = by_to;
  if (wanted(jacobians, 1)) Eigen::Map<RowMajor>(jacobians[1], 6, 6) = by_to * machine_from_cross.adjoint();
  const Eigen::MatrixXd by_model = whitening_ * by.by_from * by_carriage;
  const Eigen::Index sizes[] = {6, 2, 1, static_cast<Eigen::Index>(carriage_.terms.size())};
  Eigen::Index column = 0;
  for (std::size_t i = 0; i < blocks().size() - 2; ++i) {
    if (wanted(jacobians, 2 + i)) Eigen::Map<RowMajor>(jacobians[2 + i], 6, sizes[i]) = by_model.middleCols(column, sizes[i]);
    column += sizes[i];
  }
  return true;
}

}  // namespace crosstie::bundle::detail
