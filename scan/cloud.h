#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/cloud.h"
#include "base/machine.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/match.h"

namespace crosstie::scan {

struct CloudOptions {
  /// Largest angle between the surface's normal and the viewing ray [rad]; beyond, depths are steep and their errors not local.
  double max_grazing_rad = 1.22;  // 70 degrees
  /// Distance from the surface through the neighbours, in sigmas, from which on a point belongs to no surface (spatter, mixed pixels).
  double max_surface_sigmas = 5.0;
  /// Averages depths over squares of 2 r + 1 pixels, 0: no filter. Points within 2 r pixels of each other are then correlated; the
  /// result says over how many mm.
  int filter_radius_px = 0;
  int threads = 0;  ///< 0: as many as the machine has; no effect on the outcome

  [[nodiscard]] base::Result<> validate() const;
};

/// A scan's points in the rig's frame (the left camera's).
struct ScanCloud {
  /// Points with normals towards the camera (zero where neighbours are missing), and the fields sigma_mm (along the viewing ray, of the cameras' noise), calibration_mm
  /// (largest axis of the part of the head's calibration, which all points share and which no averaging reduces; absent where the
  /// calibration's covariance is unknown), light (mean grey level), modulation (grey levels), epipolar_px (two directions only),
  /// column, row (pixel of the left image).
  base::Cloud cloud;
  std::vector<float> depth_mm;         ///< of each pixel of the left image, z; not a number where no point is
  std::int64_t grazing = 0;            ///< points left out for their angle
  std::int64_t off_surface = 0;        ///< points left out for their distance from their neighbours' surface
  double correlation_length_mm = 0.0;  ///< of the filter; 0 without one
};

/// Depths -> points. The noise part of a point's covariance is sigma^2 along its ray, since a point lies on the ray of its own pixel by
/// definition. Errors: options; kNoUniqueSolution where no point is left.
base::Result<ScanCloud> make_cloud(const DepthMap& depths, const base::PhaseMap& left, const base::Head& head,
                                   const CloudOptions& options, const base::Progress& progress = {});

}  // namespace crosstie::scan
