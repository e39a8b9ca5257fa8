#include "bundle/detail/rank.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace crosstie::bundle::detail {
namespace {

/// Matches blocks of unknowns with groups of rows, both with their sizes as capacities.
class Matching {
 public:
  Matching(const math::WhitenedRows& rows, const math::Parameters& parameters) : groups_of_(parameters.blocks().size()) {
    for (int g = 0; g < rows.group_count(); ++g) {
      free_.push_back(rows.group(g).rows);
      for (const auto& term : rows.terms(g)) {
        if (term.size > 0) groups_of_[static_cast<std::size_t>(term.block)].push_back(g);
      }
    }
    served_.resize(free_.size());
  }

  /// One row more for an unknown of this block, perhaps by moving other blocks to other rows: an augmenting path.
  bool augment(int block) {
    seen_.assign(free_.size(), 0);
    return find(block);
  }

 private:
  bool find(int block) {
    const auto& groups = groups_of_[static_cast<std::size_t>(block)];
    for (const int g : groups) {
      if (free_[static_cast<std::size_t>(g)] == 0) continue;
      --free_[static_cast<std::size_t>(g)];
      served_[static_cast<std::size_t>(g)].push_back(block);
      return true;
    }
    for (const int g : groups) {
      if (std::exchange(seen_[static_cast<std::size_t>(g)], 1) != 0) continue;
      for (std::size_t k = 0; k < served_[static_cast<std::size_t>(g)].size(); ++k) {
        const int other = served_[static_cast<std::size_t>(g)][k];
        if (other == block || !find(other)) continue;
        served_[static_cast<std::size_t>(g)][k] = block;
        return true;
      }
    }
    return false;
  }

  std::vector<std::vector<int>> groups_of_;  // of each block
  std::vector<int> free_;                    // rows of each group that serve nobody
  std::vector<std::vector<int>> served_;     // blocks that the other rows serve
  std::vector<char> seen_;
};

}  // namespace

int structural_rank(const math::WhitenedRows& rows, const math::Parameters& parameters) {
  Matching matching(rows, parameters);
  int rank = 0;
  // Those on the fewest rows first: they have the least choice.
  for (const auto role : {math::BlockRole::kEliminated, math::BlockRole::kKept}) {
    for (std::size_t b = 0; b < parameters.blocks().size(); ++b) {
      if (parameters.blocks()[b].role != role) continue;
      for (int i = 0; i < parameters.blocks()[b].size(); ++i) rank += matching.augment(static_cast<int>(b)) ? 1 : 0;
    }
  }
  return rank;
}

}  // namespace crosstie::bundle::detail
