#pragma once

#include <vector>

#include <Eigen/Core>

#include "bundle/adjust.h"
#include "bundle/detail/estimate.h"

namespace crosstie::bundle::detail {

/// A priori covariances of the image points: the detector's plus model_sigma^2 on both coordinates, or sigma^2 for all.
class Weights {
 public:
  Weights(const Survey& survey, const AdjustOptions& options);

  [[nodiscard]] double model_sigma_px() const { return model_sigma_px_; }
  /// Whether the common part is estimated rather than given.
  [[nodiscard]] bool estimated() const { return estimated_; }

  [[nodiscard]] Eigen::Matrix2d covariance(int ray) const;
  /// Inverse Cholesky factors of all rays.
  [[nodiscard]] std::vector<Eigen::Matrix2d> whitening() const;

  /// A first guess from the robust sigma of an image coordinate.
  void guess(double robust_sigma_px);
  /// The variance component: the common part with which v'Pv of the image points equals their redundancy. Returns the relative
  /// change of the median sigma. `robust` holds the median of the standardised residuals to its expectation instead.
  double update(const Survey& survey, const Estimate& at, bool robust);

  /// Sigma of unit weight: the median over the active rays of sqrt(trace / 2).
  [[nodiscard]] double unit_sigma_px(const std::vector<char>& active) const;

 private:
  std::vector<Eigen::Matrix2d> detector_;
  double model_sigma_px_ = 0.0;
  double equal_sigma_px_ = 0.0;  ///< 0: weights are the detector's
  bool estimated_ = false;
};

}  // namespace crosstie::bundle::detail
