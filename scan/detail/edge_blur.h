#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/edge_sites.h"

namespace crosstie::scan::detail {

/// The camera's point spread, and how well it is known at a place: it varies over image and depth.
struct Blur {
  double px = kFirstBlur_px;
  double relative_sigma = 0.1;
};

/// The point spread at the clean single steps that stand out most from their residuals; the default where there are too few.
base::Result<Blur> find_blur(const Sites& sites, const EdgeImages& images, const EdgeOptions& options,
                             const base::Progress& progress);

}  // namespace crosstie::scan::detail
