#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace crosstie::report::detail {

/// An image point and what is left of it after the adjustment.
struct ImagePoint {
  Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();
  std::string tooltip;
};

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
};

/// Residuals of all images of a camera as arrows over the image, magnified as the drawing says.
std::string residual_vectors(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title);

/// Mean residual of each cell of the image where it holds enough points: what the lens model leaves behind.
std::string residual_field(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title);

/// How many points fell into each cell of the image, with the share of cells that hold any.
std::string coverage_map(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title);

/// Share of the cells of coverage_map() that hold a point, 0..1.
double coverage(const std::vector<ImagePoint>& points, const ImageSize& size);

}  // namespace crosstie::report::detail
