#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/phase_map.h"
#include "base/result.h"

namespace crosstie::base {

/// What one camera contributed to a scan.
struct ScannedCamera {
  std::string name;
  std::array<std::int64_t, kPhaseStatusCount> counts = {};  ///< pixels by PhaseStatus
  GreyNoise noise;
  bool noise_given = false;
  double light = 0.0;            ///< median mean level of the lit pixels [grey levels]
  double modulation = 0.0;       ///< median B of the lit pixels [grey levels]
  double sigma_phase_rad = 0.0;  ///< median of the finest fringes
  double residual_ratio = 0.0;   ///< see PhaseMap
  double ripple_rad = 0.0;       ///< taken out
  double word_agreement = 1.0;   ///< of the Gray code with the fringes; 1 without a Gray code
  std::int64_t repaired = 0;     ///< pixels whose fringe the neighbours told
};

/// What a scan of one station found, without its points.
struct ScanSummary {
  std::string name;  ///< of the station; may be empty
  int width = 0;     ///< of the left image
  int height = 0;
  bool both_axes = false;
  std::array<ScannedCamera, 2> cameras;
  std::int64_t points = 0;
  std::int64_t guarded = 0;    ///< pixels beside the end of a surface
  std::int64_t unmatched = 0;  ///< pixels that the other camera does not see
  std::int64_t off_curve = 0;  ///< pixels whose two phases meet off the epipolar curve
  std::int64_t grazing = 0;
  std::int64_t off_surface = 0;
  double sigma_mm = 0.0;                     ///< median along the viewing ray, noise alone
  double sigma_p95_mm = 0.0;                 ///< below which 95 % of them lie
  std::optional<double> calibration_mm;      ///< median of the calibration's part; nothing where its covariance is unknown
  std::optional<double> epipolar_median_px;  ///< signed; nothing with one direction
  double epipolar_mad_px = 0.0;              ///< 1.4826 times the median absolute deviation
  double depth_min_mm = 0.0;
  double depth_max_mm = 0.0;
  double correlation_length_mm = 0.0;  ///< of the surface filter; 0 without one
  /// Means over square cells of the left image, row by row from its top; not a number where nothing was measured.
  double cell_px = 0.0;
  Eigen::MatrixXd depth_mm;
  Eigen::MatrixXd sigma_cells_mm;
  std::vector<double> epipolar_px;  ///< a sample, for the histogram
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
