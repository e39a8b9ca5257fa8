#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/network.h"
#include "base/verification.h"

namespace crosstie::report::detail {

/// The 3D view's data as JSON that may stand inside a script element; the keys are those of viewer/src/scene.ts.
/// Points that are not finite are left out. `magnification` is that of ellipsoids and arrows to begin with.
std::string network_scene(const base::AdjustedNetwork& network, double magnification);
std::string verification_scene(const base::Verification& verification, double magnification);

/// Points of a scan, x y z and sigma in mm, seen from the camera.
std::string cloud_scene(const std::vector<Eigen::Vector4d>& points);

/// A point to be shown.
struct ShownPoint {
  std::string id;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();  ///< zero: without an ellipsoid
  double value = 0.0;                                 ///< its colour
  std::vector<std::string> about;                     ///< lines of its tooltip
  bool ring = false;
};

/// Points by the hundred thousand, without names: they are stored in single precision about their middle.
struct ShownCloud {
  struct Point {
    Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
    double value = 0.0;  ///< its colour; NaN: grey
    double sigma = 0.0;  ///< NaN: not told
  };
  std::vector<Point> points;
  std::string value;  ///< what the value is, in words; empty: the sigma itself
  std::string unit;   ///< of the value
  std::string none;   ///< what is said of a point without a value
  std::string sigma = "sigma";
  std::string sigma_unit = "mm";
};
/// Named points, those of the cloud, or both; the colours of both are of one legend. `rings`: what the points drawn as rings are.
std::string points_scene(const std::vector<ShownPoint>& shown, const std::string& legend, double magnification,
                         const ShownCloud& cloud = {}, const std::string& rings = "");

/// The three semi-axes (one sigma) of a covariance's ellipsoid as columns; zero where it is not finite.
Eigen::Matrix3d ellipsoid_axes(const Eigen::Matrix3d& cov);

/// The largest of them.
double largest_sigma(const Eigen::Matrix3d& cov);

}  // namespace crosstie::report::detail
