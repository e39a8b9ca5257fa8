#include "math/edge_profile.h"

#include <cmath>
#include <numbers>

namespace crosstie::math {

const EdgeTable& edge_table() {
  static const EdgeTable table = [] {
    EdgeTable nodes{};
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const double t = static_cast<double>(k) / kNodesPerUnit - kTableEnd;
      nodes[k] = {0.5 * std::erfc(-t / std::numbers::sqrt2),
                  std::exp(-0.5 * t * t) * std::numbers::inv_sqrtpi / std::numbers::sqrt2};
    }
    return nodes;
  }();
  return table;
}

}  // namespace crosstie::math
