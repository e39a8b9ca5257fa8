#pragma once

#include "calib/detail/problem.h"
#include "calib/detail/state.h"

namespace crosstie::calib::detail {

/// Whether half a turn brings the grid onto itself, so that an image alone cannot tell from which end its corners were counted.
[[nodiscard]] bool may_be_turned(base::BoardPattern pattern);

/// Counts the corners of a view from the other end of the board; its pose turns with them.
void turn_corners(Problem& problem, State& state, int view);

/// A board that is no perfect grid tells its ends apart: stations whose corners fit its shape better when they are counted from the
/// other end (by `v'Pv` of 30 or more, odds of a million) are turned round, with a warning. Returns how many were.
int turn_stations(Problem& problem, State& state);

}  // namespace crosstie::calib::detail
