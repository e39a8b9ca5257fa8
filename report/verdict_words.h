#pragma once

#include <string>
#include <string_view>

namespace crosstie::report {

/// The name of a verdict in words for people: "heldout_rms_px left" is "rms residual of the images left out, left". Names that are no
/// keys of results stay as they are.
std::string verdict_words(std::string_view name);

}  // namespace crosstie::report
