#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"

namespace crosstie::bundle::detail {

/// A marker that both cameras see, wherever it is.
struct CommonMarker {
  int id = 0;
  Eigen::Vector2d left_px;
  Eigen::Vector2d right_px;
  Eigen::Matrix2d left_cov;
  Eigen::Matrix2d right_cov;
  Eigen::Matrix2d left_shape_px2 = Eigen::Matrix2d::Zero();  ///< of its ellipses, see shape_of(); zero: it is a point
  Eigen::Matrix2d right_shape_px2 = Eigen::Matrix2d::Zero();
};

/// From the centres of its ellipses to the images of its circle's centre, where the ellipses show a circle.
void reduce_to_circle_centres(const base::Head& head, CommonMarker& marker);

/// Distances of the right images from the epipolar curves of the left ones [px], linear in a change of right_from_left (left
/// perturbation, rad and mm): residual = by_rig * change + noise of covariance `cov`. The noise is that of the image points and of lenses
/// and rig, of joint covariance `head_cov` (base::Head::cov). Markers behind a camera are left out.
struct Epipolar {
  Eigen::VectorXd residual_px;
  Eigen::MatrixXd by_rig;
  Eigen::MatrixXd cov;
  std::vector<int> ids;  ///< of each row
};
[[nodiscard]] Epipolar epipolar_of(const base::Head& head, const Eigen::MatrixXd& head_cov,
                                   const std::vector<CommonMarker>& markers);

/// What epipolar distances alone say of the rig.
struct RigCheck {
  double statistic = 0.0;  ///< chi-square of what they see of a change: its part in the directions that they determine
  int dof = 0;             ///< number of these directions: those in which 1 mrad or 1 mm makes a sigma or more
  std::array<double, 6> alone =
      {};  ///< of each component as if it alone had changed: standard normal where nothing did; 0: not seen
  base::Vector6d change = base::Vector6d::Zero();  ///< least, in the directions that they determine
  base::Vector6d sigma = base::Vector6d::Zero();   ///< of a component if all may have changed
  std::array<bool, 6> seen = {};                   ///< sigma below kUnseen_rad, kUnseen_mm
  double rms_px = 0.0;
  std::vector<base::Commissioning::Rejected> rejected;
};

/// A turn or a shift whose sigma is larger is not determined.
inline constexpr double kUnseen_rad = 1e-3;
inline constexpr double kUnseen_mm = 1.0;
inline constexpr std::size_t kLeastCommon = 8;  ///< five directions and some control

/// Markers that contradict all others at `ray_level` are set aside. Nothing is judged here. Fewer than kLeastCommon markers: dof is 0.
[[nodiscard]] RigCheck check_rig(const base::Head& head, const Eigen::MatrixXd& head_cov, std::vector<CommonMarker> markers,
                                 double ray_level);

}  // namespace crosstie::bundle::detail
