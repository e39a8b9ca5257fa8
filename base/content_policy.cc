#include "base/content_policy.h"

#include <array>
#include <cstddef>

#include "base/file.h"

namespace crosstie::base {

std::string csp_hash(std::string_view content) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::string hex = sha256_hex(content);
  std::array<unsigned, 33> bytes{};  // 32 and one of padding
  for (std::size_t i = 0; i < 32; ++i) bytes[i] = static_cast<unsigned>(std::stoul(hex.substr(2 * i, 2), nullptr, 16));
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const unsigned group = bytes[i] << 16 | bytes[i + 1] << 8 | bytes[i + 2];
    for (const int shift : {18, 12, 6, 0}) text += kDigits[group >> shift & 63u];
  }
  text.back() = '=';
  return "'sha256-" + text + "'";
}

}  // namespace crosstie::base
