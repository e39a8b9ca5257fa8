#include "base/detail/lzf.h"

namespace crosstie::base::detail {

std::optional<std::string> lzf_expanded(std::string_view data, std::size_t size) {
  constexpr std::size_t kMostOfThreeBytes = 264;  // the longest repetition
  if (size > (data.size() / 3 + 1) * kMostOfThreeBytes) return std::nullopt;
  std::string out;
  out.reserve(size);
  std::size_t at = 0;
  const auto next = [&] { return static_cast<std::size_t>(static_cast<unsigned char>(data[at++])); };
  while (at < data.size()) {
    const std::size_t control = next();
    if (control < 32) {  // so many bytes as they are
      const std::size_t count = control + 1;
      if (data.size() - at < count || size - out.size() < count) return std::nullopt;
      out.append(data.substr(at, count));
      at += count;
      continue;
    }
    std::size_t count = (control >> 5U) + 2;
    if (count == 9) {
      if (at == data.size()) return std::nullopt;
      count += next();
    }
    if (at == data.size()) return std::nullopt;
    const std::size_t back = ((control & 31U) << 8U) + next() + 1;
    if (back > out.size() || size - out.size() < count) return std::nullopt;
    for (std::size_t i = 0; i < count; ++i) out.push_back(out[out.size() - back]);  // may repeat what it just wrote
  }
  if (out.size() != size) return std::nullopt;
  return out;
}

}  // namespace crosstie::base::detail
