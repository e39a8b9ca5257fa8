#pragma once

#include <vector>

#include "base/machine.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::scan {

struct MatchOptions {
  double min_depth_mm = 0.0;  ///< in front of the left camera; nearer points are left out
  double max_depth_mm = 1e9;
  /// Least change of the phase over a right pixel along the epipolar curve, against the median of the scene: grazing views and mixed
  /// pixels lie below.
  double min_slope = 0.15;
  /// With fringes in both directions: largest distance of the place with equal phases from the epipolar curve, in its own sigmas
  /// and px together; beyond, the phases belong to different surfaces.
  double max_epipolar_sigmas = 5.0;
  double max_epipolar_px = 1.0;
  int guard_px = 2;  ///< pixels nearer than this to where the phase ends or jumps see two surfaces
  /// Leaves out creases of a surface, too, such as between the face and the cut of a hole: pixels there see both sides. Rough and
  /// strongly curved surfaces lose points by it.
  bool guard_creases = false;
  int threads = 0;  ///< 0: as many as the machine has; no effect on the outcome

  [[nodiscard]] base::Result<> validate() const;
};

/// For each pixel of the left image where its point lies. Not a number where there is none.
struct DepthMap {
  int width = 0;
  int height = 0;
  std::vector<float> depth_mm;  ///< z in the left camera's frame
  std::vector<float> sigma_mm;  ///< along the viewing ray, of the cameras' noise alone
  std::vector<float>
      epipolar_px;  ///< distance of the place with equal phases from the epipolar curve; empty with one direction
  std::int64_t points = 0;
  std::int64_t guarded = 0;         ///< pixels with a phase that the guard left out
  std::int64_t unmatched = 0;       ///< pixels with a phase that no right pixel shares
  std::int64_t off_curve = 0;       ///< pixels whose phases meet off the epipolar curve
  double epipolar_median_px = 0.0;  ///< of the signed distances, with two directions
  double epipolar_mad_px = 0.0;     ///< 1.4826 times the median of their absolute deviations from it
};

/// Phases of both cameras -> depths, in raw pixels: nothing is resampled but the right phases, linearly within one cell of four pixels.
///
/// One direction: the place on the epipolar curve of the distorted right camera with the left pixel's phase. Two directions: the place
/// at which both phases are equal; its distance from the curve tests the calibration, and the depth is that of the point of the curve
/// which is most likely under the covariance of the phases.
/// sigma: phases' sigmas of the left pixel and of the four right ones with the squares of their weights, through the slopes.
/// Errors: kBadInput where the maps do not fit the cameras or each other; kNoUniqueSolution where fringes run along the epipolar
/// curves, so that they tell no depth.
base::Result<DepthMap> match(const base::PhaseMap& left, const base::PhaseMap& right, const base::Head& head,
                             const MatchOptions& options, const base::Progress& progress = {});

}  // namespace crosstie::scan
