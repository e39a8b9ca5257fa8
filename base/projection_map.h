#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"

namespace crosstie::base {

/// Cells of equal size that fill an image; a value belongs to a cell's middle. Counted row by row.
struct ImageGrid {
  int width_px = 0;
  int height_px = 0;
  int columns = 0;
  int rows = 0;

  /// About `columns` square cells in a row.
  [[nodiscard]] static ImageGrid over(int width_px, int height_px, int columns) {
    const int rows = static_cast<int>(0.5 + static_cast<double>(columns) * height_px / width_px);
    return {width_px, height_px, columns, rows > 0 ? rows : 1};
  }
  [[nodiscard]] int count() const { return columns * rows; }
  /// The middle of a cell; (0, 0) is the centre of the first pixel.
  [[nodiscard]] Eigen::Vector2d middle_px(int cell) const {
    return {(cell % columns + 0.5) * width_px / columns - 0.5, (cell / columns + 0.5) * height_px / rows - 0.5};
  }
};

/// How well a camera model is known, over its image.
struct ProjectionSigmas {
  ImageGrid grid;
  double distance_mm = 0.0;  ///< of the points, along the ray; 0: at infinity
  /// [px] Of each cell the larger of the two standard deviations of a projection (the major semi-axis of its ellipse); not a number
  /// where no ray belongs to the pixel.
  Eigen::VectorXd sigma_px;
  Eigen::VectorXd minor_px;      ///< the smaller one
  Eigen::VectorXd sigma_mm;      ///< [mm] the same across the ray on the object; not a number at infinity
  std::vector<char> calibrated;  ///< Camera::calibrated_at
};

/// How well a calibrated pair of cameras knows a point, over the left image.
struct TriangulationSigmas {
  ImageGrid grid;
  double distance_mm = 0.0;  ///< from the left camera, along the ray
  Eigen::VectorXd
      sigma_mm;  ///< [mm] largest standard deviation of the point in any direction; not a number where the right camera does not see it
  Eigen::VectorXd sigma_depth_mm;   ///< along the left ray
  std::vector<char> calibrated;     ///< Camera::calibrated_at of both
  Eigen::VectorXd sigma_across_mm;  ///< the larger one across it
};

/// Whether two camera models differ by more than their covariances, taken as independent, allow.
struct DifferenceTest {
  double rms_sigma_px = 0.0;  ///< what ProjectionDifference::rms_px is expected to be
  double degrees = 0.0;       ///< of freedom that the difference has in effect: few parameters stand behind all cells
  double p = 1.0;             ///< probability of an rms at least as large if both models were true but for their covariances
  double level = 1e-3;        ///< below which p is taken to show that something else is in the difference
  double limit_px = 0.0;      ///< the rms of that probability

  [[nodiscard]] bool exceeded() const { return p < level; }
};

/// How two camera models differ after the motion that hides most of it.
struct ProjectionDifference {
  ImageGrid grid;
  double distance_mm = 0.0;  ///< 0: at infinity, the motion is a rotation
  Pose b_from_a;             ///< the implied motion of the camera's frame
  int cells = 0;             ///< that decided on the motion and on rms and max
  double rms_px = 0.0;
  double max_px = 0.0;
  double rms_before_px = 0.0;  ///< without the motion
  double max_before_px = 0.0;
  /// [px] Of each cell: where model b sees the point that a sees in its middle, minus that middle; not a number where either has no
  /// answer.
  Eigen::Matrix2Xd difference_px;
  Eigen::Matrix2Xd before_px;  ///< the same without the motion
  std::vector<char> compared;  ///< of each cell, whether it was one of `cells`
  /// [px] Of the length of the difference, sqrt(trace of its covariance); empty where a model comes without covariance.
  Eigen::VectorXd sigma_px;
  std::optional<DifferenceTest> test;  ///< where sigma_px is known and not zero everywhere
};

/// Of a map over an image, the cells that count: median, what 95 % do not exceed, and the largest; not a number where none counts.
struct MapFigures {
  double median = 0.0;
  double p95 = 0.0;
  double max = 0.0;
};

/// Cells whose value is not a number do not count.
[[nodiscard]] MapFigures map_figures(const Eigen::VectorXd& values, const std::vector<char>& counts);

/// Lengths of the difference below which `share` of the compared cells lie.
struct DifferenceQuantile {
  double share = 0.0;
  double after_px = 0.0;   ///< after the motion
  double before_px = 0.0;  ///< without it
  double sigma_px = 0.0;   ///< of the predicted standard deviations; not a number where they are unknown
};

/// For shares of 0.5, 0.68, 0.9, 0.95, 0.99 and 1.
[[nodiscard]] std::vector<DifferenceQuantile> quantiles(const ProjectionDifference& difference);

}  // namespace crosstie::base
