#pragma once

#include <optional>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/pose.h"
#include "base/result.h"
#include "base/tool_path.h"
#include "edge/nominal.h"

namespace crosstie::edge {

/// The box that the torch's tip may not leave, in the path's frame.
struct Reach {
  Eigen::Vector3d low_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d high_mm = Eigen::Vector3d::Zero();
};

struct ToolPathOptions {
  double step_mm = 2.0;  ///< distance of the path's points; 2 mm on a radius of 20 mm is 0.025 mm of chord
  /// Wavelength of the deviations along the rim that the path follows by half (Gaussian regression filter, ISO 16610-31); 10 mm: about the width
  /// of a weld pool, which follows nothing shorter. It is widened where the rim's points lie more than a quarter of it apart.
  double cutoff_mm = 10.0;
  /// The same of the normals: 60 mm, about twice a wall's thickness, below which a plate does not bend; the torch need not follow the noise of
  /// the surface's slopes.
  double tilt_cutoff_mm = 60.0;
  double max_correction_mm = 10.0;  ///< more is an Error: the hole is not where, or not what, it should be
  double max_slope = 0.1;           ///< change of the correction per length, more is an Error: spatter or a shadow, and no rim
  double max_gap_mm = 50.0;         ///< a longer stretch without a measured rim is an Error
  double blend_mm = 10.0;           ///< length over which the correction fades out inside of a gap
  bool counter_clockwise = true;    ///< as seen from the head; of an open nominal: along it
  double start_mm = 0.0;            ///< arc length of a closed nominal at which the path begins
  double bevel_rad = 0.0;        ///< the torch leans from the normal over the opening by this angle (u of the rim); -1.2 to 1.2
  double lead_rad = 0.0;         ///< then forward, the way it goes; -1.2 to 1.2
  double standoff_mm = 0.0;      ///< of the tip from the workpiece, along the torch
  double offset_mm = 0.0;        ///< of the path into the opening, for the width of the kerf or seam
  double speed_mm_per_s = 10.0;  ///< along the path
  std::optional<double> max_turn_rad_per_s = std::nullopt;  ///< the path is slower where the torch would turn faster
  std::optional<Reach> reach = std::nullopt;
  double retract_mm = 0.0;  ///< the torch comes and goes along its axis from so far; these places must be in reach, too

  [[nodiscard]] base::Result<> validate() const;
};

/// The nominal path as the measured rim corrects it.
///
/// At each place s of the nominal the correction is the local parabola through the rim's deviations u and v near it,
///     min sum_j w_j (d_j - a - b (s_j - s) - c (s_j - s)^2)^2,   w_j = exp(-pi ((s_j - s) / (0.7309 cutoff))^2) / sigma_j^2,
/// that is d(s) = sum_j h_j d_j, so its variance is known: sum_j h_j^2 sigma_j^2 of what each point has alone and |sum_j h_j S_j|^2 of
/// what they share, which does not average down. What the rim's points share moves the path with them; where the nominal was placed
/// does not matter where it is corrected. Normals are the nominal's, tilted as the measured surface is from
/// them, which is smoothed in the same way by its own cutoff; in gaps they are the nominal's. Tangents are the way within that
/// surface: positions tell its slope along the way less well than the surface itself.
///
/// A gap is what the rim calls so, and any stretch between points that is longer than cutoff and four usual distances. There the
/// nominal is kept: the correction fades out over blend_mm from either end, and sigma is that of the nominal's place (`place_cov`)
/// and of the rim's rms correction elsewhere, since the rim may be as far off there. Every point says where it comes from.
///
/// `frame_from_hole` places the nominal in the rim's frame, `place_cov` is its covariance (base::Pose's convention).
///
/// Errors: kUsage for options out of their domain; kBadInput, with the place along the nominal, for corrections, slopes and gaps
/// beyond their limits, for a path that leaves the reach, crosses itself or folds (an offset larger than the radius).
/// Warnings: wide_filter, gap (each), coarse_step.
base::Result<base::ToolPath> tool_path(const base::EdgeCurve& edge, const NominalCurve& nominal,
                                       const base::Pose& frame_from_hole, const base::Matrix6d& place_cov,
                                       const ToolPathOptions& options = {});

}  // namespace crosstie::edge
