#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/pose.h"
#include "base/result.h"
#include "bundle/commission.h"
#include "bundle/detail/head_measurements.h"

namespace crosstie::bundle::detail {

/// The head's poses at the stations before they are told that they stand on one axis.
struct StationPoses {
  std::vector<std::string> names;
  std::vector<double> axis_mm;
  std::vector<base::Pose> machine_from_rig;
  Eigen::MatrixXd cov;  ///< joint, 6 per station
};

/// The straight axis through them.
struct StraightAxis {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  double scale_ppm = 0.0;
  std::vector<std::string> reasons;  ///< of each station: why its reading is not believed; empty: it is
};

/// Robust: medians of the slopes between all pairs of stations. A station that lies far off is named.
/// kNoUniqueSolution where the readings do not span the axis; kBadInput for readings in inches or metres, for a head that does not
/// travel along machine X, and for stations of the same reading that stand in different places.
base::Result<StraightAxis> straight_axis(const StationPoses& stations);

/// Least scatter of stops in the model: no carriage repeats better, and what is far below the stations' own sigmas only costs digits.
inline constexpr double kLeastStop_mm = 2e-4;
inline constexpr double kLeastStop_rad = 1e-7;

/// Which error motions the stations show, and how much their stops scatter.
struct AxisMotion {
  std::vector<base::ErrorMotion> terms;  ///< all that were tested
  double stop_sigma_mm = 0.0;
  double stop_sigma_rad = 0.0;
  bool stops_scatter = false;  ///< the stop sigmas were estimated
  double excess_p = 1.0;       ///< probability of the full model's residuals under the stations' covariance alone
  base::Pose at_middle;        ///< start values of the adjustment
  /// Of each station from the axis as found, [turn, shift of the rig's origin] in the machine's axes, and standardised.
  std::vector<base::Vector6d> off_axis;
  std::vector<double> w;
  double degrees = 0.0;   ///< of Student's t where stop sigmas were estimated; 0: the normal distribution
  double least_w = 3.29;  ///< a motion of so many sigmas of its test is just significant

  /// Those that take part in the adjustment.
  [[nodiscard]] std::vector<AxisTerm> taken() const;
};

/// Generalised least squares on the stations' poses, linear about the straight axis; equivalent to the adjustment in which the stations'
/// joint covariance was found. Terms enter one by one, the most significant first, while its level is below options.significance, and
/// leave if they are not significant beside the others. The rest take part too, each under a prior about 0 whose sigma
/// is the motion that is just significant: dropped, one just below the level would bias head and lenses by several sigmas; and a sigma
/// after what was found would take the data twice.
AxisMotion find_motion(const StationPoses& stations, const Carriage& carriage, double scale_ppm, double reading_sigma_mm,
                       const CommissionOptions& options);

/// Covariance of the perturbation of a station's pose by the scatter of stops and by its reading.
base::Matrix6d stop_covariance(const base::Pose& machine_from_rig, const Eigen::Vector3d& direction, double sigma_mm,
                               double sigma_rad, double reading_sigma_mm);

/// Probability of a normal (degrees = 0) or Student-t value at least as far from 0.
double two_sided_p(double t, double degrees);

}  // namespace crosstie::bundle::detail
