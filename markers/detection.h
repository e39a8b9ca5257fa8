#pragma once

#include <vector>

#include "markers/detect.h"

namespace crosstie::markers {

/// What detect() finds, and what its fits tell beside it.
struct Detection {
  ImageObservations observations;
  /// [px] Of each observation: standard deviation of the Gaussian that blurs the edge of its dot, lens and pixel together (a pixel alone is
  /// 0.29 px); 0 for tags, which have no dot.
  std::vector<double> blur_px;
};

/// As detect(), with the same observations, options and errors.
[[nodiscard]] Result<Detection> detect_in_detail(const ImageView& image, const MarkerFamily& family,
                                                 const DetectOptions& options = {}, const Progress& progress = {});

}  // namespace crosstie::markers
