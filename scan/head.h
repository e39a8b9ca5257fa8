#pragma once

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"

namespace crosstie::scan {

/// Two calibrated cameras that are bolted to each other; the rig's frame is the left one's.
struct ScanHead {
  base::Camera left;
  base::Camera right;
  base::Pose right_from_left;
  /// Of the left lens's parameters, the right one's, then right_from_left [rad, mm]; empty where unknown. It is one block: all points
  /// of all scans with this head share it.
  Eigen::MatrixXd covariance = {};
};

}  // namespace crosstie::scan
