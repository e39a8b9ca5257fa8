#include "devices/detail/shown_line.h"

#include <cstddef>

#include <fmt/format.h>

namespace crosstie::devices::detail {

std::string shown_line(std::string_view line) {
  constexpr std::size_t kShown = 40;
  std::string shown;
  for (const char c : line.substr(0, kShown)) {
    if (c >= ' ' && c <= '~') {
      shown += c;
    } else {
      shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  return line.size() > kShown ? shown + "..." : shown;
}

}  // namespace crosstie::devices::detail
