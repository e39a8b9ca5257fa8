#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// How far points lie from a surface, along its normal: positive on the side to which the normal points.
struct SurfaceDeviations {
  std::string reference;          ///< what the surface is: "mesh", "cloud", "cylinder", "cone", "plane", "sphere"
  std::size_t count = 0;          ///< points that were compared
  std::size_t beyond_border = 0;  ///< left out: nearest to the reference's border
  std::size_t too_far = 0;        ///< left out: farther than the gate
  double gate_mm = 0.0;
  double mean_mm = 0.0;
  double sigma_mm = 0.0;  ///< scatter about the mean
  double rms_mm = 0.0;
  double p95_mm = 0.0;  ///< 95 % of the |deviations| are below
  double max_mm = 0.0;  ///< largest |deviation|
  double tolerance_mm = 0.0;
  double in_tolerance = 0.0;  ///< share of the points with |deviation| <= tolerance
  std::optional<double>
      normalised_rms;  ///< deviation over the points' own sigma along the normal; none where no sigma is known
  /// Of a best fit before the comparison, else as it was given; with the directions that the surface does not hold, which stayed.
  Pose reference_from_measured;
  bool best_fit = false;
  std::vector<std::string> held;
  int iterations = 0;
  std::vector<Eigen::Vector3d> points;  ///< in the reference's frame; those that were compared
  std::vector<double> deviations_mm;    ///< of each
};

/// A cylinder or cone fitted to a cloud, held against its nominal.
struct ShapeDeviations {
  std::string shape;                                   ///< "cylinder" or "cone"
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< on the axis
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d direction_sigma_rad = Eigen::Vector3d::Zero();  ///< of its components
  double diameter_mm = 0.0;                                       ///< across the axis at point_mm
  double diameter_sigma_mm = 0.0;
  double apex_angle_rad = 0.0;  ///< full; 0 of a cylinder
  double apex_angle_sigma_rad = 0.0;
  double low_mm = 0.0;  ///< extent of the points along the axis, from point_mm
  double high_mm = 0.0;
  double low_diameter_mm = 0.0;  ///< at its two ends
  double low_diameter_sigma_mm = 0.0;
  double high_diameter_mm = 0.0;
  double high_diameter_sigma_mm = 0.0;
  double rms_mm = 0.0;
  double form_mm = 0.0;
  double sigma0 = 0.0;
  std::size_t count = 0;
  std::size_t rejected = 0;
  /// Against the nominal, where there is one: angle between the axes, distance of the fitted axis from the nominal one at the points'
  /// middle, diameter at that place and apex angle, each fitted less nominal, with its sigma.
  struct Difference {
    double axis_angle_rad = 0.0;
    double axis_angle_sigma_rad = 0.0;
    double axis_distance_mm = 0.0;
    double axis_distance_sigma_mm = 0.0;
    double diameter_mm = 0.0;
    double diameter_sigma_mm = 0.0;
    double apex_angle_rad = 0.0;
    double apex_angle_sigma_rad = 0.0;
  };
  std::optional<Difference> difference;
  std::vector<Warning> warnings;
};

/// A hole's rim against a reference rim or a nominal.
struct EdgeVerification {
  std::size_t count = 0;
  double rms_mm = 0.0;  ///< of the distances across the rim
  double p95_mm = 0.0;
  double max_mm = 0.0;
  double normalised_rms = 0.0;  ///< deviation over sigma, both directions
  std::vector<double> s_mm;     ///< along the reference
  std::vector<double> u_mm;
  std::vector<double> v_mm;
  std::vector<double> sigma_u_mm;
  std::vector<double> sigma_v_mm;
};

/// All that was compared of a cloud and its hole.
struct SurfaceVerification {
  std::optional<SurfaceDeviations> surface;
  std::optional<ShapeDeviations> shape;
  std::optional<EdgeVerification> edge;
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
