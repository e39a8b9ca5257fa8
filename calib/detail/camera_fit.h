#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"
#include "calib/detail/pose_fit.h"

namespace crosstie::calib::detail {

/// One camera alone: its lens and the pose of each view, the points taken as they are.
struct CameraFit {
  Eigen::VectorXd lens;
  std::vector<base::Pose> board_from_camera;  ///< of each view
  int iterations = 0;
};

/// Levenberg-Marquardt from the given values with a Cauchy loss of `robust_sigmas` sigmas; the poses, which only the lens joins, are
/// eliminated view by view. It ends where the cost no longer falls by a part of 1e-6: a start value, no result. False where
/// a point lies behind its camera at the start.
bool fit_camera(base::LensModel model, const std::vector<PoseData>& views, double robust_sigmas, CameraFit& fit);

}  // namespace crosstie::calib::detail
