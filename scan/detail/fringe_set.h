#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/plane.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/image_drift.h"
#include "scan/detail/noise.h"

namespace crosstie::scan::detail {

/// One set of fringe images, solved pixel by pixel.
struct FringeSet {
  int steps = 0;
  double exposure = 1.0;
  double white_level = 255.0;     ///< grey level of a saturated pixel
  double gain = 0.0;              ///< var(phase [rad]) = gain var(level) / B^2 where no sample was cut off
  base::Plane<float> turns;       ///< phase in [0, 1)
  base::Plane<float> modulation;  ///< B; 0 where too few samples were left
  base::Plane<float> mean;        ///< A; the levels' plain mean where too few samples were left
  base::Plane<float> squares;     ///< of the residuals, over their degrees of freedom; 0 where there are none
  base::Plane<float> gains;       ///< as `gain`, of each pixel; empty where no sample of any pixel was cut off
  ImageDrift::Estimate drift;     ///< of each image, from a sample of the pixels

  [[nodiscard]] float gain_at(std::size_t pixel) const { return gains.empty() ? static_cast<float>(gain) : gains[pixel]; }
};

struct SolveSetOptions {
  std::optional<base::GreyNoise> noise;  ///< of the camera; nothing: that of the statistics
  int threads = 0;
};

/// Solves images of one set and one exposure with these shifts [periods]; all of one size and depth. `statistics` takes a sample of
/// the residuals. A sample within 3 sigmas of an end of the grey scale is looked at again: it counts as cut off where what the other
/// samples predict for it lies there, so that noise alone does not choose.
base::Result<FringeSet> solve_set(const std::vector<base::Image>& images, const std::vector<double>& shifts, double exposure,
                                  const SolveSetOptions& options, ResidualStatistics& statistics,
                                  const base::Progress& progress);

}  // namespace crosstie::scan::detail
