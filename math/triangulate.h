#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "base/machine.h"

namespace crosstie::math {

/// Both images of a point: left, right.
struct HeadSight {
  std::array<Eigen::Vector2d, 2> pixel;
  std::array<Eigen::Matrix2d, 2> weight;  ///< inverse covariances [1/px^2]
};

struct Triangulated {
  Eigen::Vector3d p_in_rig_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();  ///< of the images' noise alone
};

/// The point with the least squared distance of its images from both observations under their weights, by Gauss-Newton from `start` (in the
/// rig's frame, in front of both cameras) on. Nothing where it leaves a camera's domain or the rays do not determine it.
[[nodiscard]] std::optional<Triangulated> triangulate(const base::Head& head, const HeadSight& sight,
                                                      const Eigen::Vector3d& start);

}  // namespace crosstie::math
