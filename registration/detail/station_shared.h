#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/cloud.h"
#include "base/machine.h"
#include "base/stitching.h"

namespace crosstie::registration::detail {

/// What all points of one station share: how the head's adjustment moves them, and their common covariance; from some hundred places of its
/// cloud, between which both change slowly.
class StationShared {
 public:
  StationShared(const base::Stitching& stitching, int station, const std::optional<base::Head>& head, const base::Cloud& cloud);

  /// Of a point in the rig: what the head's adjustment adds to it.
  [[nodiscard]] Eigen::Vector3d change(const Eigen::Vector3d& p_in_rig_mm) const;
  /// Common covariance of a point, in the common frame.
  [[nodiscard]] Eigen::Matrix3d cov(const Eigen::Vector3d& p_in_rig_mm) const;

 private:
  [[nodiscard]] Eigen::VectorXd basis(const Eigen::Vector3d& p_in_rig_mm) const;

  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double scale_ = 1.0;
  bool moved_ = false;
  Eigen::Matrix<double, Eigen::Dynamic, 3> change_;  ///< coefficients over basis()
  Eigen::Matrix<double, Eigen::Dynamic, 6> cov_;     ///< of xx xy xz yy yz zz
};

}  // namespace crosstie::registration::detail
