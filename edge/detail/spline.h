#pragma once

#include <vector>

#include <Eigen/Core>

namespace crosstie::edge::detail {

/// A cubic spline through points in space, C2, over the length of the chords; natural at the ends of an open one, periodic round a
/// closed one (de Boor, A Practical Guide to Splines, 1978, chapter 4). With `straight` the points are joined by lines.
class Spline {
 public:
  Spline() = default;
  /// `knots` ascending: one per point, and one more, where it closes, of a closed one.
  Spline(std::vector<double> knots, const std::vector<Eigen::Vector3d>& points, bool closed, bool straight);

  struct Value {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d derivative = Eigen::Vector3d::Zero();
  };
  /// Inside of the knots' range.
  [[nodiscard]] Value at(double t) const;

  [[nodiscard]] const std::vector<double>& knots() const { return knots_; }
  [[nodiscard]] bool empty() const { return knots_.empty(); }

 private:
  std::vector<double> knots_;
  std::vector<Eigen::Vector3d> points_;   ///< one per knot
  std::vector<Eigen::Vector3d> seconds_;  ///< second derivatives there; empty of straight lines
};

}  // namespace crosstie::edge::detail
