#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/result.h"
#include "markers/family.h"

namespace crosstie::markers {

/// Number of segments in which two rings differ, in the rotation in which they are most alike: so many must be misread before
/// one becomes the other.
[[nodiscard]] int cyclic_distance(std::uint64_t ring_a, std::uint64_t ring_b, int bits);

/// The same for two codes of any family: over all rotations of rings, over quarter turns of tags.
[[nodiscard]] int code_distance(const MarkerFamily& family, std::uint64_t code_a, std::uint64_t code_b);

struct IdChoice {
  std::vector<int> ids;       ///< sorted
  int smallest_distance = 0;  ///< between any two of them; 0 for a single id
};

/// Chooses `count` of the ids in `pool` (each of the family, once) whose codes lie far apart in cyclic distance: beginning with
/// the pool's lowest id, always the one whose nearest chosen neighbour is farthest, the lowest id among equals; where codes of
/// both parities are in the pool, the same among those of one parity, and the best of the three is taken (greedy max-min: not
/// always the best choice there is, but always the same one). Errors (kUsage): a count that is not 1 to the pool's size, an id
/// that the family does not have, an id given twice.
[[nodiscard]] base::Result<IdChoice> choose_distant_ids(const MarkerFamily& family, std::span<const int> pool, int count);

}  // namespace crosstie::markers
