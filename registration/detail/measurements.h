#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "math/model.h"

namespace crosstie::registration::detail {

/// A marker as a station saw it: blocks pose (machine_from_rig), point, and where there is a commissioned head the shared block z.
///     residual = whitening * (R' (X - t) - p - G z),   d(R' (X - t)) / d[w, v] = R' [skew(X), -I]
class MarkerSighting final : public math::Measurement {
 public:
  MarkerSighting(std::vector<int> blocks, const Eigen::Vector3d& p_in_rig_mm, const Eigen::Matrix3d& whitening,
                 Eigen::Matrix3Xd by_shared)
      : Measurement(std::move(blocks)), p_in_rig_mm_(p_in_rig_mm), whitening_(whitening), by_shared_(std::move(by_shared)) {}

  [[nodiscard]] int rows() const override { return 3; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::Vector3d p_in_rig_mm_;
  Eigen::Matrix3d whitening_;
  Eigen::Matrix3Xd by_shared_;
};

/// Coordinates of a list: blocks are its points, then, where it has a frame of its own, machine_from_part.
///     residual = whitening * (part_from_machine * X - X_list)
class ListedMarkers final : public math::Measurement {
 public:
  ListedMarkers(std::vector<int> blocks, bool own_frame, Eigen::VectorXd listed_mm, Eigen::MatrixXd whitening)
      : Measurement(std::move(blocks)),
        own_frame_(own_frame),
        listed_mm_(std::move(listed_mm)),
        whitening_(std::move(whitening)) {}

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  bool own_frame_;
  Eigen::VectorXd listed_mm_;
  Eigen::MatrixXd whitening_;
};

/// A stop on the commissioned axis: blocks pose, shared.
///     residual = whitening * (difference(at, pose) - J z), to first order in z
class AxisStop final : public math::Measurement {
 public:
  AxisStop(int pose, int shared, const base::Pose& at, Eigen::Matrix<double, 6, Eigen::Dynamic> by_shared,
           const base::Matrix6d& whitening)
      : Measurement({pose, shared}), at_(at), by_shared_(std::move(by_shared)), whitening_(whitening) {}

  [[nodiscard]] int rows() const override { return 6; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  base::Pose at_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> by_shared_;
  base::Matrix6d whitening_;
};

/// An overlap, reduced at the poses where it was linearised: blocks pose of a, pose of b, and where there is one the shared block; with
/// d the perturbation of a less that of b,
///     residual = root [d; z] + offset.
/// To be made anew after every step.
class OverlapFactor final : public math::Measurement {
 public:
  OverlapFactor(std::vector<int> blocks, Eigen::MatrixXd root, Eigen::VectorXd offset)
      : Measurement(std::move(blocks)), root_(std::move(root)), offset_(std::move(offset)) {}

  [[nodiscard]] int rows() const override { return static_cast<int>(root_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::MatrixXd root_;
  Eigen::VectorXd offset_;
};

}  // namespace crosstie::registration::detail
