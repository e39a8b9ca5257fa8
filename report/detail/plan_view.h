#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace crosstie::report::detail {

/// A point of a plan view with its error ellipse, its deviation, or both.
struct PlanPoint {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
  Eigen::Vector3d deviation_mm = Eigen::Vector3d::Zero();
  std::string tooltip;
  bool hollow = false;  ///< a ring in place of the dot: a target without a code
};

struct PlanOptions {
  int horizontal = 0;  ///< 0 x, 1 y, 2 z
  int vertical = 1;
  bool arrows = false;   ///< deviations
  bool ellipses = true;  ///< one sigma, at the same magnification
  double magnification = 1.0;
};

/// Points in two of their three coordinates, to one scale, with magnified ellipses or arrows and a bar that tells how long they
/// are. The ids are written where there is room.
std::string plan_view(const std::vector<PlanPoint>& points, std::string_view title, const PlanOptions& options);

/// 1, 2 or 5 x 10^n, so that lengths of `typical_mm` become about 1/20 of the extent of the points.
double plan_magnification(const std::vector<PlanPoint>& points, double typical_mm);

/// The two axes that show the most of the points first, then the one with their depth: {{0, 1}, {0, 2}} and permutations.
std::vector<std::pair<int, int>> plan_axes(const std::vector<PlanPoint>& points);

}  // namespace crosstie::report::detail
