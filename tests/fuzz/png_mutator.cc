// libFuzzer's mutations, after which the chunks of a PNG have their check sums again: without that nearly all mutated files are refused for
// these alone, and what is behind is never reached. One in eight stays as it is.
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <zlib.h>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

std::uint32_t big32(const std::uint8_t* at) {
  return std::uint32_t{at[0]} << 24U | std::uint32_t{at[1]} << 16U | std::uint32_t{at[2]} << 8U | at[3];
}

void mend_check_sums(std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kSignature = 8;
  constexpr std::size_t kFrame = 12;  // length, kind, check sum
  for (std::size_t at = kSignature; size >= kFrame && at <= size - kFrame;) {
    const std::size_t length = big32(data + at);
    if (length > size - at - kFrame) return;
    const auto sum = static_cast<std::uint32_t>(::crc32(0, data + at + 4, static_cast<uInt>(length + 4)));
    for (unsigned i = 0; i < 4; ++i) data[at + 8 + length + i] = static_cast<std::uint8_t>(sum >> (24U - 8U * i));
    at += length + kFrame;
  }
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  size = LLVMFuzzerMutate(data, size, max_size);
  if (seed % 8 != 0 && size > 8 && std::memcmp(data, "\x89PNG", 4) == 0) mend_check_sums(data, size);
  return size;
}
