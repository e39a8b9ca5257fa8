#pragma once

#include <Eigen/Core>

#include "base/camera.h"
#include "math/model.h"

namespace crosstie::math {

/// A marker seen in an image: blocks camera (lens parameters), pose (network_from_camera), point.
///     residual = whitening * (project(R' (X - t)) - measured),   d(R' (X - t)) / d[w, v] = R' [skew(X), -I],   / dX = R'
/// On a rig the pose is network_from_rig, and a fourth block is the camera's mount, rig_from_camera: the same formula once more,
/// with the point in the rig's frame.
class ImagePoint final : public Measurement {
 public:
  struct Blocks {
    int camera = 0;
    int pose = 0;
    int point = 0;
    int mount = -1;  ///< -1: the camera has a pose of its own
  };

  /// `whitening` is the inverse of the Cholesky factor of the covariance [1/px].
  ImagePoint(const Blocks& blocks, base::LensModel lens, const Eigen::Vector2d& measured_px, const Eigen::Matrix2d& whitening);

  [[nodiscard]] int rows() const override { return 2; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;
  [[nodiscard]] bool may_be_wrong() const override { return true; }

 private:
  base::LensModel lens_;
  Eigen::Vector2d measured_px_;
  Eigen::Matrix2d whitening_;
};

}  // namespace crosstie::math
