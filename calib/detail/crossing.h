#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/image.h"

namespace crosstie::calib::detail {

/// One of the two lines that cross in a chessboard's corner, where it passes the corner.
struct CrossingLine {
  double direction_rad = 0.0;     ///< from +x towards +y
  double curvature_per_px = 0.0;  ///< of the lens's distortion; positive towards (-sin, cos) of the direction
};

/// Where to look, and how far: no other line may come nearer to the corner than about twice the radius.
struct CrossingSearch {
  Eigen::Vector2d start_px = Eigen::Vector2d::Zero();
  CrossingLine first, second;
  double radius_px = 5.0;
};

struct Crossing {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< of either coordinate (rms), from the residuals
  double blur_px = 0.0;   ///< sigma of lens and pixel together
  double contrast = 0.0;  ///< half the difference of the levels of bright and dark squares; negative: the other way round
  double residual = 0.0;  ///< rms [grey levels]
};

/// The corner of a chessboard by least squares over all pixels within the radius. With d1, d2 the distances from both lines, the image is
///     level = mean + gradient . p + contrast * s(d1 / blur, d2 / blur),     s = E[sign(d1 + e1) sign(d2 + e2)],
/// e normally distributed in the plane: the board's sign convolved with a Gaussian, exact for any angle between the lines. Unknown: corner, both
/// directions, blur, contrast, mean, gradient; the curvatures are held. Free of the bias towards pixel borders or centres that weighted
/// gradients have on sharp images: below 0.002 px from a blur of 0.5 px on (tests/calib/crossing_test.cc), and at the Cramer-Rao bound.
///
/// Nothing where the disc leaves the image, where the lines lie within 18 degrees of each other, or where what is found is no such corner: no
/// minimum within a third of the radius (1 px at least) of the start, contrast below four times the residuals, a blur of more than half of the radius.
std::optional<Crossing> find_crossing(const base::ImageView& image, const CrossingSearch& search);

}  // namespace crosstie::calib::detail
