#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/result.h"

namespace crosstie::scan::detail {

/// The viewing directions of all pixels of a camera in a frame that is turned against it: (X/Z, Y/Z) of the ray through each pixel's
/// centre. Rays are computed on a grid of kSpacing px and interpolated by cubics: off by less than 2e-4 px for lenses whose valid
/// domain holds the image.
class RectifiedMap {
 public:
  static constexpr int kSpacing = 16;  ///< [px]

  /// Error kBadInput where the lens model has no rays for the image's middle.
  static base::Result<RectifiedMap> make(const base::Camera& camera, const Eigen::Matrix3d& rectified_from_camera, int threads);

  /// X/Z and Y/Z of a row of pixels; not a number outside of the lens model's domain.
  void row(int y, float* x_over_z, float* y_over_z) const;

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

 private:
  int width_ = 0;
  int height_ = 0;
  int columns_ = 0;  // of nodes; node (1, 1) is pixel (0, 0)
  std::vector<Eigen::Vector2d> nodes_;
};

}  // namespace crosstie::scan::detail
