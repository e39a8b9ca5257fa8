#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "bundle/adjust.h"
#include "bundle/detail/estimate.h"

namespace crosstie::bundle::detail {

/// A priori covariances of the image points: the detector's plus model_sigma^2 on both coordinates, or sigma^2 for all. Coded and
/// uncoded targets have common parts of their own where these are estimated: what surrounds a dot is part of how well it is seen.
class Weights {
 public:
  Weights(const Survey& survey, const AdjustOptions& options);

  /// Of coded markers.
  [[nodiscard]] double model_sigma_px() const { return model_sigma_px_[kCoded]; }
  /// Of uncoded targets.
  [[nodiscard]] double uncoded_model_sigma_px() const { return model_sigma_px_[kUncoded]; }
  /// Whether the common part is estimated rather than given.
  [[nodiscard]] bool estimated() const { return estimated_; }

  [[nodiscard]] Eigen::Matrix2d covariance(int ray) const;
  /// The same of an uncoded dot that is no ray yet, from the detector's covariance.
  [[nodiscard]] Eigen::Matrix2d of_detector(const Eigen::Matrix2d& cov_px2) const;
  /// Takes the detector's covariances anew after uncoded targets were added; their common part starts as that of the coded ones.
  void renew(const Survey& survey);
  /// Inverse Cholesky factors of all rays.
  [[nodiscard]] std::vector<Eigen::Matrix2d> whitening() const;

  /// A first guess from the robust sigma of an image coordinate.
  void guess(double robust_sigma_px);
  /// The variance components: the common parts with which v'Pv of the image points of either kind equals their redundancy.
  /// Returns the largest relative change of a median sigma. `robust` holds the median of the standardised residuals to its expectation instead.
  double update(const Survey& survey, const Estimate& at, bool robust);

  /// Multiplies the sigmas of a camera's image points, whatever they come from.
  void scale(int camera, double ratio);

  /// Sigma of unit weight: the median over the active rays of sqrt(trace / 2).
  [[nodiscard]] double unit_sigma_px(const std::vector<char>& active) const;

 private:
  enum Kind : std::size_t { kCoded, kUncoded, kKinds };
  struct Item;

  [[nodiscard]] Eigen::Matrix2d covariance(const Eigen::Matrix2d& detector, Kind kind) const;
  [[nodiscard]] double component(const std::vector<Item>& items, bool robust) const;

  std::vector<Eigen::Matrix2d> detector_;
  std::vector<Kind> kinds_;    ///< of each ray
  std::vector<int> cameras_;   ///< of each ray
  std::vector<double> ratio_;  ///< of each camera: by which its sigmas are multiplied
  std::array<double, kKinds> model_sigma_px_ = {};
  double equal_sigma_px_ = 0.0;  ///< 0: weights are the detector's
  bool estimated_ = false;
};

}  // namespace crosstie::bundle::detail
