#pragma once

#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "math/shape_fit.h"

namespace crosstie::math {

/// How a ball was touched.
struct SphereProbingOptions {
  double stylus_diameter_mm = 0.0;  ///< of the probe's tip ball; 0: the hits are points of the surface
  double probe_sigma_mm = 0.0;      ///< standard deviation of each coordinate of a hit; must be given
  /// Diameter of the ball where it is known (its certificate); nothing: free.
  std::optional<double> diameter_mm = std::nullopt;
  double diameter_sigma_mm = 0.0;  ///< of that; 0: held
  /// With a free diameter the hits must be spread over a cap of at least this opening: 90 degrees.
  double least_opening_rad = std::numbers::pi / 2;

  [[nodiscard]] base::Result<> validate() const;
};

/// A ball's centre from touch-probe hits.
struct SphereProbing {
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< in the frame of the hits
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();    ///< as probe_sigma_mm (and diameter_sigma_mm) says
  double diameter_mm = 0.0;                             ///< of the ball, the stylus taken off
  double diameter_sigma_mm = 0.0;                       ///< 0 where it was held
  double form_mm = 0.0;                                 ///< largest minus smallest distance of the hits from the sphere
  double sigma0 = 0.0;                                  ///< residuals over probe_sigma_mm; 0 without redundancy
  long redundancy = 0;
  std::size_t hits = 0;
  double opening_rad = 0.0;  ///< of the least cap about the centre that holds all hits: pi is a hemisphere
  std::vector<double> residuals_mm;
  std::vector<base::Warning> warnings;
};

/// Centre of a ball from the centres of the stylus tip at each hit, which lie on a sphere of ball plus stylus diameter: orthogonal
/// least squares of at least four hits. Lobing of the probe and a bent stylus are in no sigma of the fit.
///
/// What to expect, sd(x y z) / probe_sigma_mm with z towards the pole: pole and four hits on the equator, diameter free, 0.71 0.71
/// 1.12; nine hits (and four at 45 degrees) 0.58 0.58 0.85; five in a cap of 60 degrees 1.41 1.41 8.35, with the diameter known 1.41
/// 1.41 0.50.
///
/// Errors: kUsage for options out of their domain; kNoUniqueSolution for fewer than four hits, hits in one plane, and hits in a
/// cap of less than `least_opening_rad` where the diameter is free: its error would go into the centre many times over;
/// kBadInput for hits that are not finite or a sphere smaller than the stylus.
base::Result<SphereProbing> fit_probed_sphere(std::span<const Eigen::Vector3d> tip_centres_mm,
                                              const SphereProbingOptions& options);

/// Opening angle of the least cap that holds all `directions` (unit length); 0 to 2 pi, to about 1e-4.
[[nodiscard]] double opening_of(std::span<const Eigen::Vector3d> directions);

}  // namespace crosstie::math
