#pragma once

#include <string>
#include <vector>

#include "base/board.h"
#include "base/result.h"

namespace crosstie::calib {

/// Which images belong to one moment, by their names: what the names of a camera's images have in common is taken off at both
/// ends (never part of a number), and images of different cameras with the same rest are one station; numbers are compared
/// as numbers, so left_7 belongs to right_07. Stations are sorted by that rest, numbers by value.
/// Errors (kBadInput): an image of a camera that is not in the list, two images of one camera with the same rest.
base::Result<std::vector<base::BoardStation>> pair_by_name(const std::vector<base::BoardImage>& images,
                                                           const std::vector<std::string>& cameras);

}  // namespace crosstie::calib
