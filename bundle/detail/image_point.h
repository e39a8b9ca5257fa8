#pragma once

#include <Eigen/Core>

#include "base/camera.h"
#include "bundle/detail/model.h"

namespace crosstie::bundle::detail {

/// A marker seen in an image: blocks camera (lens parameters), pose (network_from_camera), point.
///     residual = whitening * (project(R' (X - t)) - measured),   d(R' (X - t)) / d[w, v] = R' [skew(X), -I],   / dX = R'
class ImagePoint final : public Measurement {
 public:
  /// `whitening` is the inverse of the Cholesky factor of the covariance [1/px].
  ImagePoint(int camera_block, int pose_block, int point_block, base::LensModel lens, const Eigen::Vector2d& measured_px,
             const Eigen::Matrix2d& whitening);

  [[nodiscard]] int rows() const override { return 2; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;
  [[nodiscard]] bool may_be_wrong() const override { return true; }

 private:
  base::LensModel lens_;
  Eigen::Vector2d measured_px_;
  Eigen::Matrix2d whitening_;
};

}  // namespace crosstie::bundle::detail
