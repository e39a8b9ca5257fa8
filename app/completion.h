#pragma once

#include <string>
#include <vector>

#include "app/verb.h"

namespace crosstie::app {

/// A completion script for bash: verbs, options, files and folders, and values that are a known list.
[[nodiscard]] std::string bash_completion(const std::vector<Verb>& verbs);

}  // namespace crosstie::app
