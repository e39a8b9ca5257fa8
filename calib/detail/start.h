#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calib/detail/problem.h"
#include "calib/detail/state.h"

namespace crosstie::calib::detail {

/// Start values of all unknowns from the corners alone, the board taken as nominal: the lens model with four distortion parameters,
/// poses, and the rig where at least one station is paired. Views that fit no plane, and pairs that contradict the rig, leave with a
/// reason. Errors: see calibrate().
base::Result<State> start(Problem& problem, const base::Progress& progress);

/// Changes the lens model: of OpenCV's, parameters that both have are kept, others are 0; a splined model comes as near as it can.
void change_lens(State& state, base::LensModel to);

/// The median over active corners of the residual's length, as the sigma of one coordinate if it were normal [px].
double robust_sigma_px(const Problem& problem, const State& state);

/// The length of a corner's residual [px]; infinite where it cannot be computed.
double distance_px(const Problem& problem, const State& state, const Corner& corner);

}  // namespace crosstie::calib::detail
