#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "edge/detail/spline.h"
#include "edge/nominal.h"

namespace crosstie::edge::detail {

/// Point and derivative by the curve's own parameter, and the surface's normal.
struct Jet {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d derivative = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// The outline with these sizes at t in [0, 1), lifted to the tower; not finite where it misses the tower.
[[nodiscard]] Jet outline_jet(const Nominal& nominal, const std::vector<double>& size_mm, double t);

/// A point of a curve by its parameter.
struct Foot {
  double t = 0.0;
  double distance_mm = 0.0;
  Jet jet;
};

/// A nominal curve with its tables: knots in the parameter, their points and arc lengths.
class Curve {
 public:
  /// `with_lengths` false: for nearest() and jet() alone.
  static base::Result<Curve> make(const Nominal& nominal, bool with_lengths = true);

  [[nodiscard]] Jet jet(double t) const;
  [[nodiscard]] Foot nearest(const Eigen::Vector3d& p) const;
  [[nodiscard]] double length_at(double t) const;
  [[nodiscard]] double parameter_at(double s_mm) const;
  [[nodiscard]] double length_mm() const { return lengths_.back(); }
  [[nodiscard]] bool closed() const { return nominal_.closed; }
  [[nodiscard]] const Nominal& nominal() const { return nominal_; }
  [[nodiscard]] const std::vector<double>& corners_mm() const { return corners_mm_; }
  [[nodiscard]] const std::vector<Eigen::Vector3d>& knot_points() const { return points_; }

 private:
  [[nodiscard]] Jet list_jet(double t) const;
  [[nodiscard]] std::size_t segment_of(double t) const;
  base::Result<> make_list(bool with_lengths);
  [[nodiscard]] double arc(double t0, double t1) const;
  void make_tables(const std::vector<double>& knots, bool with_lengths);

  Nominal nominal_;
  Spline spline_;         ///< of a list with spline: the points
  Spline normal_spline_;  ///< of its normals where known
  Eigen::Vector3d plane_normal_ = Eigen::Vector3d::UnitZ();
  std::vector<double> knots_;  ///< of the parameter, ascending
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> lengths_;  ///< arc length at the knots
  std::vector<double> corners_mm_;
};

/// The same with the tangent normalised and the normal made square to it.
[[nodiscard]] CurvePoint curve_point(const Curve& curve, double t);

}  // namespace crosstie::edge::detail
