#pragma once

#include <string>
#include <vector>

#include "base/calibration.h"
#include "base/progress.h"
#include "base/result.h"
#include "calib/detail/estimate.h"

namespace crosstie::calib::detail {

/// A part of the stations that is held out while the rest is solved.
struct Fold {
  std::string name;
  std::vector<char> used;  ///< of each station: takes part in the solve; the others are held out
};

/// Odd and even stations (the first is odd); none where either half would have fewer than three views of a camera.
std::vector<Fold> halves_of(const Problem& problem, const State& state);
/// `count` folds by turns, fewer where there are fewer stations; none where a solve would have fewer than three views of a camera.
std::vector<Fold> folds_of(const Problem& problem, const State& state, int count);

/// A solve with part of the stations, and how well it predicts the others.
struct HeldOut {
  State state;
  Estimate estimate;
  std::vector<double>
      square_px2;  ///< of each view held out: sum of its corners' squares with the best pose; negative: not held out
  base::HeldOutFold summary;
};

/// Solves with the fold's stations from the values of `all`, with the corners' sigma of all views, and fits the poses of the others.
base::Result<HeldOut> hold_out(const Problem& problem, const State& all, const Fold& fold, const base::Progress& progress);

/// Sum over folds of the squares of each view, and the number of their corners; of one camera, or of all (-1).
double heldout_rms_px(const Problem& problem, const State& all, const std::vector<HeldOut>& folds, int camera);

/// What two halves that share one board say of each other.
void compare_halves(const Problem& problem, const HeldOut& odd, const HeldOut& even, base::CrossValidation& result);

}  // namespace crosstie::calib::detail
