#pragma once

#include <vector>

#include "base/calibration.h"
#include "base/progress.h"
#include "base/result.h"
#include "calib/calibrate.h"
#include "calib/detail/hold_out.h"

namespace crosstie::calib::detail {

/// The ladder of lens models, simplest first: OpenCV's, then, for up to 8000 corners, a splined one that covers the images.
std::vector<base::LensModel> lens_ladder(const Problem& problem, const State& state);

/// What the folds say of one model.
struct LensScore {
  State state;  ///< all views
  std::vector<HeldOut> folds;
  base::LensTrial trial;
};

/// Solves all views and every fold with each model, from the values and the corners that take part of `from`.
base::Result<std::vector<LensScore>> score_lenses(const Problem& problem, const CalibrateOptions& options, const State& from,
                                                  const std::vector<base::LensModel>& models, const base::Progress& progress);

/// The simplest model that is not worse than the best by more than one standard error of the paired differences of the views' mean
/// squares; fills LensTrial::worse_by_sigmas and ::chosen. The index into `scores`; -1 where none has a result.
int choose_lens(const Problem& problem, std::vector<LensScore>& scores);

}  // namespace crosstie::calib::detail
