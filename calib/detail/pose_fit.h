#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"

namespace crosstie::calib::detail {

/// Corners of one image with the points that they show and the a priori sigma of each.
struct PoseData {
  Eigen::Matrix3Xd points;  ///< [mm] in the board frame
  Eigen::Matrix2Xd pixels;
  Eigen::VectorXd sigma_px;

  [[nodiscard]] Eigen::Index count() const { return points.cols(); }
};

struct PoseFit {
  base::Pose board_from_camera;
  double square_sum = 0.0;  ///< of whitened residuals
  double square_px2 = 0.0;  ///< of residuals in px
};

/// The pose that shows the points at the pixels, for a lens that is known: Levenberg-Marquardt from `start`, with a Cauchy loss of
/// that many sigmas where `robust_sigmas` is above 0. Nothing where points come to lie behind the camera at the start.
std::optional<PoseFit> fit_pose(base::LensModel model, const Eigen::VectorXd& lens, const PoseData& data,
                                const base::Pose& start, double robust_sigmas = 0.0);

/// The pose from which a flat board looks nearly the same: its plane mirrored at the plane across the line of sight.
base::Pose mirrored_pose(const base::Pose& board_from_camera);

}  // namespace crosstie::calib::detail
