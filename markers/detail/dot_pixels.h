#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "markers/detail/dot_kernel.h"
#include "markers/detail/ellipse.h"

namespace crosstie::markers::detail {

/// Pixels around a dot as arrays, in units of `radius_px` from `origin_px`.
struct PixelSet {
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();
  double radius_px = 1.0;
  std::size_t used = 0;  ///< pixels; the arrays are filled up to a multiple of kPixelPadding
  std::vector<float> x, y, grey, weight, limit2;
  std::vector<float> residual, inside, slope;  ///< of the model that was evaluated last

  /// Takes the pixels with inner_rho <= rho <= outer_rho of the ellipse (none left out inside where inner_rho <= 0): all of them,
  /// or every x_step-th of every y_step-th row.
  void collect(const base::ImageView& image, const Ellipse& ellipse, double inner_rho, double outer_rho, int x_step = 1,
               int y_step = 1);

  void evaluate(const DotModel& model);
  [[nodiscard]] DotPixels view() const { return {x.data(), y.data(), grey.data(), weight.data(), limit2.data(), x.size()}; }
};

}  // namespace crosstie::markers::detail
