#include "markers/tag_layout.h"

namespace crosstie::markers {

std::uint64_t quarter_turned(const TagLayout& layout, std::uint64_t code, int bits) {
  const int last = layout.total_cells - 1;
  std::uint64_t turned = 0;
  for (int y = 0; y <= last; ++y) {
    for (int x = 0; x <= last; ++x) {
      const int bit = layout.at(x, y);
      if (bit < 0 || ((code >> (bits - 1 - bit)) & 1U) == 0) continue;
      turned |= std::uint64_t{1} << (bits - 1 - layout.at(last - y, x));
    }
  }
  return turned;
}

}  // namespace crosstie::markers
