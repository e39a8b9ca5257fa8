#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "verify/detail/partners.h"

namespace crosstie::verify::detail {

/// The frame that a fit found, and what it estimated to find it.
struct FittedFrame {
  base::Pose reference_from_measured;
  double scale = 1.0;
  int parameters = 6;     ///< 0, 6 or 7
  bool weighted = false;  ///< with the inverse of each pair's covariance
};

struct Predicted {
  std::vector<Eigen::Matrix3d> deviation_cov_mm2;  ///< of the deviations after the fit, one per partner
  Eigen::Matrix<double, 7, 7> parameter_cov = Eigen::Matrix<double, 7, 7>::Zero();  ///< [rotation, translation, scale]
};

/// Propagates the covariances of both sides through the fit: with d = J x the effect of its parameters on the deviations, the
/// deviations after the fit have the covariance (I - J A) S (I - J A)' and the parameters A S A', A = (J'WJ)^-1 J'W.
/// `measured_cov_mm2` is the full covariance of the measured list, or empty.
Predicted predict(const Partners& partners, const FittedFrame& frame, const Eigen::MatrixXd& measured_cov_mm2);

}  // namespace crosstie::verify::detail
