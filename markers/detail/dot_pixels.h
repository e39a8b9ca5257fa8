#pragma once

#include <vector>

#include <Eigen/Core>

#include "markers/detail/ellipse.h"
#include "markers/detail/sampler.h"

namespace crosstie::markers::detail {

/// A pixel relative to the fit's origin, and its grey level.
struct DotPixel {
  double x, y, grey;
};

/// The pixels with rho <= outer_rho and not farther than `depth_px` inside the edge, about `origin_px`.
inline std::vector<DotPixel> collect_pixels(const Sampler& image, const Ellipse& ellipse, double outer_rho, double depth_px,
                                            const Eigen::Vector2d& origin_px) {
  std::vector<DotPixel> pixels;
  const Eigen::Matrix2d shape = ellipse.shape();
  const Eigen::Vector2d half = outer_rho * ellipse.half_extent_px();
  const int x0 = std::max(0, static_cast<int>(std::ceil(ellipse.centre_px.x() - half.x())));
  const int x1 = std::min(image.image().width - 1, static_cast<int>(std::floor(ellipse.centre_px.x() + half.x())));
  const int y0 = std::max(0, static_cast<int>(std::ceil(ellipse.centre_px.y() - half.y())));
  const int y1 = std::min(image.image().height - 1, static_cast<int>(std::floor(ellipse.centre_px.y() + half.y())));
  const double inner_rho = 1.0 - depth_px / ellipse.semi_minor_px;
  const double inner2 = inner_rho > 0.0 ? inner_rho * inner_rho : -1.0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double ex = x - ellipse.centre_px.x();
      const double ey = y - ellipse.centre_px.y();
      const double rho2 = shape(0, 0) * ex * ex + 2.0 * shape(0, 1) * ex * ey + shape(1, 1) * ey * ey;
      if (rho2 <= outer_rho * outer_rho && rho2 >= inner2) {
        pixels.push_back({x - origin_px.x(), y - origin_px.y(), image.at(x, y)});
      }
    }
  }
  return pixels;
}

}  // namespace crosstie::markers::detail
