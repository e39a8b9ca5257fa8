#pragma once

#include <Eigen/Core>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::base {

/// Where the parameters of a commissioning begin in Commissioning::covariance, and how many there are.
struct CommissioningLayout {
  Eigen::Index left = 0, left_size = 0;    ///< lens of the left camera
  Eigen::Index right = 0, right_size = 0;  ///< of the right camera
  Eigen::Index rig = 0;                    ///< right_from_left, 6
  Eigen::Index frame = 0, frame_size = 0;  ///< those of MachineFrame::cov
  Eigen::Index cross = 0;                  ///< machine_from_cross, 6, then the growth
  Eigen::Index markers = 0;                ///< x y z of each of Commissioning::markers

  /// Both lenses and the rig stand first: the parameters of Head::cov.
  [[nodiscard]] Eigen::Index head_size() const { return frame; }
};

/// Error kBadInput where the covariance does not belong to the head, the axis and the markers.
Result<CommissioningLayout> commissioning_layout(const Commissioning& commissioning);

}  // namespace crosstie::base
