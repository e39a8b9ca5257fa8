#pragma once

#include <string>

namespace crosstie::report::detail {

/// From calm blue over green to alarming red for 0..1, "#rrggbb"; the viewer has the same stops (viewer/src/colour.ts).
std::string sequential_colour(double fraction);

/// Blue towards -1, red towards +1, transparent at 0, so that text on it stays readable: "#rrggbbaa".
std::string diverging_colour(double value);

}  // namespace crosstie::report::detail
