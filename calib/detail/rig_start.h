#pragma once

#include "base/result.h"
#include "calib/detail/problem.h"
#include "calib/detail/state.h"

namespace crosstie::calib::detail {

/// left_from_right from the poses that both cameras have at each station: that of the pair with which most others agree. A pair that
/// contradicts it (images of different moments, a rig that moved) is taken apart, with a warning; where its right corners counted from
/// the other end agree, they are turned round. Nothing without pairs. Error (kBadInput) where most pairs contradict each other.
base::Result<> start_rig(Problem& problem, State& state);

}  // namespace crosstie::calib::detail
