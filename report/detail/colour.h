#pragma once

#include <string>

namespace crosstie::report::detail {

/// From calm blue over green to alarming red for 0..1, "#rrggbb"; the viewer has the same stops (viewer/src/colour.ts).
std::string sequential_colour(double fraction);

/// Blue for -1, the page's neutral for 0, red for +1.
std::string diverging_colour(double value);

}  // namespace crosstie::report::detail
