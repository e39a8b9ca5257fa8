#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "bundle/detail/dots.h"
#include "bundle/detail/views.h"

namespace crosstie::bundle::detail {

/// All that a search for groups looks at.
struct DotScene {
  std::vector<std::optional<View>> views;  ///< of each image of the survey
  std::vector<Dot> dots;
  std::vector<DotGrid> grids;  ///< of each image
};

/// The place on which rays of dots agree.
struct Place {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();        ///< in network
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Identity();  ///< from the dots' Dot::cov_px2
  double square_sum = 0.0;                                ///< v'Pv
};

/// Dots that can be images of one target.
struct DotGroup {
  std::vector<int> dots;  ///< one in each image, by image
  Place place;
  int visible = 0;         ///< images that the point lies in
  double radius_mm = 0.0;  ///< of the target, the median over its dots; 0 where sizes are unknown
};

/// Least squares of the dots' distances from the prediction, from a start near the place; nothing where it does not settle.
std::optional<Place> locate(const DotScene& scene, std::span<const int> dots, const Eigen::Vector3d& start);

/// Radius of the circle that appears as this dot's ellipse if it lies at `point`: the ellipse's larger axis in the plane across
/// the ray, which does not depend on the circle's tilt. 0 where the ellipse is not known. `cos_tilt` receives the ratio of both.
double radius_mm(const View& view, const Dot& dot, const Eigen::Vector3d& point, double* cos_tilt = nullptr);

/// Whether two radii (mm) can be those of one target: to 15 %, which covers blur, light and the first order of the formula, and
/// four sigmas of the dots' sizes.
bool same_size(double radius_a, const Dot& a, double radius_b, const Dot& b);

/// From two dots whose rays meet: the dots of all other images that agree with their place, taken in as the place becomes better
/// known, and judged anew twice with it. A dot agrees if its distance from the prediction passes the chi-square test of 1e-4
/// with the covariances of both, if it is the only one that does in its image, and if its size is the group's. Nothing where
/// the two do not agree, or where the place is that of markers with ids (within their dots in a quarter of its images or more).
std::optional<DotGroup> grow(const DotScene& scene, int dot_a, int dot_b, double distance_from_a_mm, double min_angle_rad);

/// How many really different directions a group is seen from: at `least_rad` or more from each other.
int count_directions(const DotScene& scene, std::span<const int> dots, const Eigen::Vector3d& point, double least_rad);

}  // namespace crosstie::bundle::detail
