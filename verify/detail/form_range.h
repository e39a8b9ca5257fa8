#pragma once

#include <vector>

#include <Eigen/Core>

namespace crosstie::verify::detail {

/// Deviations of points from a least-squares shape, laid flat.
struct FormPoints {
  std::vector<Eigen::Vector2d> place_mm;
  Eigen::VectorXd deviation_mm;
  Eigen::VectorXd variance_mm2;  ///< of each deviation
  Eigen::MatrixXd design;        ///< d deviation / d (less the shape's parameters), a row for each point
};

/// Deviations beyond the points' own sigmas count: variances grow to the scatter of the first `kept` points, in their proportions, and never
/// shrink. Where the points have no sigmas, all have that scatter.
void raise_to_scatter(FormPoints& points, Eigen::Index kept);

/// How neighbouring points err together.
struct Correlation {
  double share = 1.0;     ///< N_eff / N
  double place_mm = 0.0;  ///< edge of the places at which it showed most; 0 where points are independent
};

/// Means of the deviations over square places of two, four, eight ... point distances have f^2 times the variance that independent points
/// predict; N_eff / N is the smallest 1 / f^2 among those beyond chance (1 %). Places must be at least sixteen.
Correlation correlation_of(const FormPoints& points);

/// Largest less smallest of the values without those `count` whose sizes are largest; `values` is shuffled.
double trimmed_range(std::vector<double>& values, std::size_t count);

/// Standard deviation of the trimmed range of deviations: places of `place_mm` (single points for 0) are drawn with replacement, the
/// shape is fitted anew by `design`, the permitted share discarded. Seeded.
double range_sigma(const FormPoints& points, double discard_share, double place_mm, int resamples);

/// The range 2 q beyond which the share `discard_share` of normal deviations of these variances lies: sum of 2 (1 - Phi(q / sigma_i)) is
/// that share of the points. Where less than one point may be discarded: half a point.
double predicted_range(const Eigen::VectorXd& variance_mm2, double discard_share);

}  // namespace crosstie::verify::detail
