#include "markers/detail/code_rules.h"

#include <bit>

namespace crosstie::markers::detail {
namespace {

std::uint32_t rotated(std::uint32_t ring, int by, int bits) {
  const std::uint32_t all = (std::uint32_t{1} << bits) - 1U;
  return by == 0 ? ring : ((ring << by) | (ring >> (bits - by))) & all;
}

/// Numbers the canonical codes below 2^bits that `is_code` accepts from 1 on.
template <typename Rule>
std::vector<MarkerCode> numbered_codes(int bits, Rule is_code) {
  std::vector<MarkerCode> codes;
  const std::uint32_t all = (std::uint32_t{1} << bits) - 1U;
  for (std::uint32_t code = 1; code < all; ++code) {
    if (std::popcount(code) % 2 != 0 || !is_code(code) || smallest_rotation(code, bits) != code) continue;
    codes.push_back({static_cast<int>(codes.size()) + 1, code});
  }
  return codes;
}

}  // namespace

std::vector<MarkerCode> start_sequence_codes(std::uint32_t start_sequence, int start_bits, int data_bits) {
  const int bits = start_bits + data_bits;
  std::vector<MarkerCode> codes;
  for (std::uint32_t n = 0; n < (std::uint32_t{1} << data_bits); ++n) {
    const std::uint32_t code = (start_sequence << data_bits) | (n ^ (n >> 1));
    int starts = 0;
    for (int by = 0; by < bits; ++by) starts += (rotated(code, by, bits) >> data_bits) == start_sequence ? 1 : 0;
    if (starts == 1) codes.push_back({static_cast<int>(n), code});
  }
  return codes;
}

std::vector<MarkerCode> opposite_pair_codes(int bits) {
  return numbered_codes(bits, [half = bits / 2](std::uint32_t code) { return (code & (code >> half)) != 0; });
}

std::vector<MarkerCode> wide_code_codes(int bits) {
  return numbered_codes(bits, [smallest = std::uint32_t{1} << (bits / 2)](std::uint32_t code) {
    return code > smallest && std::popcount(code) >= 4;
  });
}

}  // namespace crosstie::markers::detail
