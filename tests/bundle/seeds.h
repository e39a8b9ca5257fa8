#pragma once

#include <algorithm>
#include <cstdlib>

namespace crosstie::tests {

/// How many seeds a sampling test draws: `usual`, or what the environment variable CROSSTIE_SEEDS says for a longer study.
inline int seeds(int usual) {
  const char* wanted = std::getenv("CROSSTIE_SEEDS");
  return wanted == nullptr ? usual : std::max(1, std::atoi(wanted));
}

}  // namespace crosstie::tests
