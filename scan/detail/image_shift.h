#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "base/result.h"

namespace crosstie::scan::detail {

/// How far two images of the same pattern, taken at different times, are shifted against each other, in parts of the image.
///
/// In each part the later image is the earlier one moved by d, brighter by a gain and an offset:
///     later - earlier = -d . grad + gain * earlier + offset,
/// linear in the four, by least squares over its pixels that are not saturated; the scatter of the residuals gives the sigmas.
/// Patterns along different directions tell different components of d; their normal equations are added. A d of up to a pixel comes out
/// as it is, more as at least as much or as residuals that nothing explains (`changed`).
class ImageShift {
 public:
  static constexpr int kColumns = 12;  ///< parts across the image; rows of parts of the same extent

  ImageShift(int width, int height);

  /// Both of the same size and depth. `variance(level)` is that of a grey level.
  base::Result<> add(const base::ImageView& earlier, const base::ImageView& later, double read_variance, double shot_variance,
                     int threads);

  /// A part of the image, or all of it.
  struct Part {
    Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< in the directions that the patterns tell; 0 in others
    double sigma_px = 0.0;                               ///< along the shift
    double statistic = 0.0;                              ///< chi-square of the shift, 2 degrees of freedom or fewer
    bool told = false;                                   ///< some direction is told to kSharp_px
  };
  static constexpr double kSharp_px = 0.05;
  [[nodiscard]] std::vector<Part> parts() const;
  [[nodiscard]] Part whole() const;
  /// Share of the parts with light whose residuals exceed three times the cameras' noise and 3 % of the light.
  [[nodiscard]] double changed() const;

 private:
  struct Sums {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d pull = Eigen::Vector2d::Zero();
    bool changed = false;
    bool lit = false;
  };
  template <typename Sample>
  void add_part(const base::ImageView& earlier, const base::ImageView& later, int column, int row, double read_variance,
                double shot_variance);
  static Part solve(const Sums& sums);

  int width_;
  int height_;
  int rows_;
  std::vector<Sums> sums_;
};

}  // namespace crosstie::scan::detail
