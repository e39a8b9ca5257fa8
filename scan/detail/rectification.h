#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::scan::detail {

/// The frame whose x axis runs from the left to the right camera: epipolar curves are its lines of equal Y/Z.
struct Rectification {
  Eigen::Matrix3d rectified_from_left = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d rectified_from_right = Eigen::Matrix3d::Identity();
  double baseline_mm = 0.0;
};

/// kBadInput where the cameras do not look across their baseline.
base::Result<Rectification> rectify(const base::Pose& right_from_left);

/// How far a point of the right image lies off the epipolar curve of one of the left image: the difference of both rays' Y/Z in the
/// rectified frame, right minus left, times the right camera's focal length [px].
struct OffCurve {
  double distance_px = 0.0;
  double sigma_px = 0.0;  ///< from the covariances of both points
};
std::optional<double> off_curve_px(const base::Head& head, const Rectification& frame, const Eigen::Vector2d& left_px,
                                   const Eigen::Vector2d& right_px);
std::optional<OffCurve> off_curve(const base::Head& head, const Rectification& frame, const Eigen::Vector2d& left_px,
                                  const Eigen::Matrix2d& left_cov_px2, const Eigen::Vector2d& right_px,
                                  const Eigen::Matrix2d& right_cov_px2);

}  // namespace crosstie::scan::detail
