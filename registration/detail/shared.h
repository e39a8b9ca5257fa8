#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/result.h"
#include "registration/stitch.h"

namespace crosstie::registration::detail {

/// Derivatives of a triangulated point by the head's parameters (as Head::cov has them), its pixels kept: 3 x parameters. `left_weight`:
/// how much better the left pixel is believed than the right one (a scan's points lie on the ray of their left pixel). Nothing where a
/// camera does not see the point.
std::optional<Eigen::Matrix3Xd> point_by_head(const base::Head& head, const Eigen::Vector3d& p_in_rig_mm, double left_weight);

/// What all stations share, as few independent unknowns z of unit variance: first those of the frame, then those of the head that the
/// frame does not tell.
///     frame's perturbation = frame_root z_f,     head's parameters = head_by_frame z_f + head_root z_h
class SharedModes {
 public:
  /// `places`: points in rig where the head's effect counts; combinations that move them by less than a hundredth of a micrometre are dropped.
  static base::Result<SharedModes> make(const CommissionedHead& commissioned, const std::vector<Eigen::Vector3d>& places);

  [[nodiscard]] int size() const { return static_cast<int>(frame_root_.cols() + head_root_.cols()); }
  [[nodiscard]] int frame_size() const { return static_cast<int>(frame_root_.cols()); }
  /// Derivatives of a point in the rig by z, zero where the head does not see it: 3 x size().
  [[nodiscard]] Eigen::Matrix3Xd point_by_modes(const Eigen::Vector3d& p_in_rig_mm, double left_weight) const;
  /// Derivatives of the perturbation of machine_from_rig at a reading by z: 6 x size().
  [[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> pose_by_modes(double axis_mm) const;
  /// Head's parameters by z: parameters x size().
  [[nodiscard]] Eigen::MatrixXd head_by_modes() const;

 private:
  const CommissionedHead* commissioned_ = nullptr;
  Eigen::MatrixXd frame_root_;
  Eigen::MatrixXd head_by_frame_;
  Eigen::MatrixXd head_root_;
};

}  // namespace crosstie::registration::detail
