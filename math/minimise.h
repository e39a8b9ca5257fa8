#pragma once

#include <optional>

#include "base/progress.h"
#include "base/result.h"
#include "math/model.h"

namespace crosstie::math {

struct MinimiseOptions {
  int max_iterations = 100;
  /// Scale of a Cauchy loss on measurements that may be wrong, in their whitened units; nothing: least squares.
  std::optional<double> robust_scale = {};
  double function_tolerance = 1e-9;  ///< relative change of the sum of squares at which it stops
};

struct MinimiseSummary {
  int iterations = 0;
  double cost = 0.0;  ///< half the (robust) sum of squares
};

/// Finds the minimum by Levenberg-Marquardt (Ceres, one thread, so that it repeats bit for bit). A free datum is no obstacle.
base::Result<MinimiseSummary> minimise(Model& model, const MinimiseOptions& options, const base::Progress& progress = {});

}  // namespace crosstie::math
