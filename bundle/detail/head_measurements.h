#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "math/model.h"

namespace crosstie::bundle::detail {

/// What is known of lenses and rig from their calibration: blocks left lens, right lens, mount (rig_from_camera of the right one).
///     residual = whitening * (lenses - mean, difference(mean pose, mount))
class HeadPrior final : public math::Measurement {
 public:
  HeadPrior(std::vector<int> blocks, Eigen::VectorXd left, Eigen::VectorXd right, const base::Pose& rig_from_right,
            Eigen::MatrixXd whitening);

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::VectorXd left_;
  Eigen::VectorXd right_;
  base::Pose rig_from_right_;
  Eigen::MatrixXd whitening_;
};

/// What is known of points of the cross from its list: blocks are the points (at the machine's temperature), then the growth e [ppm].
///     residual = whitening * (X - (1 + 1e-6 e) X_list)
class ListedPoints final : public math::Measurement {
 public:
  ListedPoints(std::vector<int> points, int growth, Eigen::VectorXd listed_mm, Eigen::MatrixXd whitening);

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::VectorXd listed_mm_;
  Eigen::MatrixXd whitening_;
};

/// A ball's centre as probed, in the coordinates that count: blocks machine_from_cross, point.
///     residual = whitening * (machine_from_cross * X - probed)
class ProbedCentre final : public math::Measurement {
 public:
  ProbedCentre(int machine_from_cross, int point, const Eigen::Vector3d& probed_mm, Eigen::MatrixXd whitening);

  [[nodiscard]] int rows() const override { return static_cast<int>(whitening_.rows()); }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Eigen::Vector3d probed_mm_;
  Eigen::MatrixXd whitening_;
};

/// One term of an error motion, see base::ErrorMotion.
struct AxisTerm {
  int component = 0;  ///< X, Y, Z or A, B, C
  int order = 1;
  bool angle = false;
  double prior_sigma = 0.0;  ///< of a value near 0 [mm or rad]; 0: it is free
};

/// What the model of the carriage needs beside its unknowns.
struct Carriage {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< about which the unknown direction is perturbed
  Eigen::Matrix<double, 3, 2> across = Eigen::Matrix<double, 3, 2>::Zero();
  double middle_mm = 0.0;
  double half_mm = 0.0;
  Eigen::Vector3d pivot_mm = Eigen::Vector3d::Zero();  ///< of the carriage, in machine, when it stands in the middle
  std::vector<AxisTerm> terms;

  [[nodiscard]] double place(double axis_mm) const { return (axis_mm - middle_mm) / half_mm; }
  [[nodiscard]] Eigen::Vector3d direction_at(const double* perturbation) const {
    return (direction + across * Eigen::Vector2d(perturbation[0], perturbation[1])).normalized();
  }
};

/// The head's pose as LinearAxis has it, of the values of its four blocks: machine_from_rig at the middle, the direction's two
/// perturbations [rad], the scale [ppm], the terms. The derivatives (6 x 6, 2, 1, terms) are filled where asked for.
base::Pose carried(const Carriage& carriage, double axis_mm, const double* const* values, Eigen::MatrixXd* jacobian);

/// A station stands on the axis: blocks machine_from_cross, cross_from_rig, then the four of carried().
///     residual = whitening * difference(carried, machine_from_cross * cross_from_rig)
class OnAxis final : public math::Measurement {
 public:
  OnAxis(std::vector<int> blocks, const Carriage& carriage, double axis_mm, const base::Matrix6d& whitening)
      : Measurement(std::move(blocks)), carriage_(carriage), axis_mm_(axis_mm), whitening_(whitening) {}

  [[nodiscard]] int rows() const override { return 6; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override;

 private:
  Carriage carriage_;
  double axis_mm_;
  base::Matrix6d whitening_;
};

/// Derivatives of base::difference(from, to) by the left perturbations of both.
struct DifferenceJacobians {
  base::Matrix6d by_from;
  base::Matrix6d by_to;
};
[[nodiscard]] DifferenceJacobians difference_jacobians(const base::Vector6d& difference);

/// From the perturbation of a pose to [turn, shift of its origin], and back with the origin negated.
[[nodiscard]] base::Matrix6d at_origin(const Eigen::Vector3d& origin_mm);

}  // namespace crosstie::bundle::detail
