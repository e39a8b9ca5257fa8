#include "verify/detail/predicted.h"

#include <Eigen/Cholesky>

namespace crosstie::verify::detail {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// The effect of [w, u, ds] about the centre of the points, so that the normal equations stay well scaled.
MatrixXd design(const Partners& partners, const FittedFrame& frame, const Vector3d& centre_b) {
  MatrixXd jacobian(3 * static_cast<Index>(partners.pairs.size()), frame.parameters);
  for (std::size_t i = 0; i < partners.pairs.size(); ++i) {
    const Vector3d turned = frame.reference_from_measured.rotation * (partners.pairs[i].b_mm - centre_b);
    Eigen::Matrix<double, 3, 7> row;
    row << -base::skew(frame.scale * turned), Matrix3d::Identity(), turned;
    jacobian.middleRows<3>(3 * static_cast<Index>(i)) = row.leftCols(frame.parameters);
  }
  return jacobian;
}

Matrix3d measured_block(const Partners& partners, std::size_t i, std::size_t j, const Matrix3d& turn,
                        const MatrixXd& measured_cov_mm2) {
  if (measured_cov_mm2.size() == 0) {
    return i == j ? Matrix3d(turn * partners.pairs[i].cov_b_mm2 * turn.transpose()) : Matrix3d::Zero();
  }
  const auto row = 3 * static_cast<Index>(partners.measured_index[i]);
  const auto column = 3 * static_cast<Index>(partners.measured_index[j]);
  return turn * measured_cov_mm2.block<3, 3>(row, column) * turn.transpose();
}

/// Covariance of all deviations before the fit times `right`, block by block, without forming it.
MatrixXd times_covariance(const Partners& partners, const Matrix3d& turn, const MatrixXd& measured_cov_mm2,
                          const MatrixXd& right) {
  MatrixXd product = MatrixXd::Zero(right.rows(), right.cols());
  for (std::size_t i = 0; i < partners.pairs.size(); ++i) {
    auto target = product.middleRows<3>(3 * static_cast<Index>(i));
    target += partners.pairs[i].cov_a_mm2 * right.middleRows<3>(3 * static_cast<Index>(i));
    const bool full = measured_cov_mm2.size() > 0;
    for (std::size_t j = full ? 0 : i; j < (full ? partners.pairs.size() : i + 1); ++j) {
      target += measured_block(partners, i, j, turn, measured_cov_mm2) * right.middleRows<3>(3 * static_cast<Index>(j));
    }
  }
  return product;
}

}  // namespace

Predicted predict(const Partners& partners, const FittedFrame& frame, const MatrixXd& measured_cov_mm2) {
  const auto count = partners.pairs.size();
  const Matrix3d turn = frame.scale * frame.reference_from_measured.rotation.toRotationMatrix();
  Vector3d centre_b = Vector3d::Zero();
  for (const math::AlignmentPair& pair : partners.pairs) centre_b += pair.b_mm / static_cast<double>(count);

  Predicted result;
  std::vector<Matrix3d> before(count);
  for (std::size_t i = 0; i < count; ++i) {
    before[i] = partners.pairs[i].cov_a_mm2 + measured_block(partners, i, i, turn, measured_cov_mm2);
  }
  if (frame.parameters == 0) {
    result.deviation_cov_mm2 = std::move(before);
    return result;
  }

  const MatrixXd jacobian = design(partners, frame, centre_b);
  MatrixXd weighted = MatrixXd::Zero(jacobian.rows(), jacobian.cols());
  for (std::size_t i = 0; i < count; ++i) {
    if (!partners.used[i]) continue;
    const auto row = 3 * static_cast<Index>(i);
    const Matrix3d cov = partners.pairs[i].cov_a_mm2 + turn * partners.pairs[i].cov_b_mm2 * turn.transpose();
    weighted.middleRows<3>(row) =
        frame.weighted ? MatrixXd(cov.llt().solve(jacobian.middleRows<3>(row))) : MatrixXd(jacobian.middleRows<3>(row));
  }
  const MatrixXd estimator = MatrixXd(weighted.transpose() * jacobian).ldlt().solve(weighted.transpose());
  const MatrixXd cross = times_covariance(partners, turn, measured_cov_mm2, estimator.transpose());  // S A'
  const MatrixXd parameters = estimator * cross;

  result.deviation_cov_mm2.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = 3 * static_cast<Index>(i);
    const MatrixXd j = jacobian.middleRows<3>(row);
    const Matrix3d shared = j * cross.middleRows<3>(row).transpose();
    result.deviation_cov_mm2[i] = before[i] - shared - shared.transpose() + j * parameters * j.transpose();
  }

  // From the image of the centre to the origin, as base::Pose writes its covariance.
  Eigen::Matrix<double, 7, 7> to_origin = Eigen::Matrix<double, 7, 7>::Identity();
  to_origin.block<3, 3>(3, 0) = base::skew(turn * centre_b + frame.reference_from_measured.translation_mm);
  to_origin.block<3, 1>(3, 6) = -(frame.reference_from_measured.rotation * centre_b);
  result.parameter_cov.topLeftCorner(frame.parameters, frame.parameters) = parameters;
  result.parameter_cov = to_origin * result.parameter_cov * to_origin.transpose();
  return result;
}

}  // namespace crosstie::verify::detail
