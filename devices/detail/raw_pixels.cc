#include "devices/detail/raw_pixels.h"

#include <bit>
#include <cstdint>
#include <cstring>

#include <fmt/format.h>

namespace crosstie::devices::detail {
namespace {

static_assert(std::endian::native == std::endian::little, "samples of 16 bits are copied as they come");

bool packed(RawFormat format) { return format == RawFormat::kMono12p || format == RawFormat::kMono12Packed; }

std::uint16_t join(unsigned high, int shift, unsigned low) { return static_cast<std::uint16_t>(high << shift | low); }

/// Sample `i` of packed ones; two of them share three bytes.
std::uint16_t packed_sample(std::span<const std::byte> bytes, std::size_t i, RawFormat format) {
  const auto byte = [&](std::size_t k) { return std::to_integer<unsigned>(bytes[i / 2 * 3 + k]); };
  const bool first = i % 2 == 0;
  if (format == RawFormat::kMono12p) return first ? join(byte(1) & 0xf, 8, byte(0)) : join(byte(2), 4, byte(1) >> 4);
  return first ? join(byte(0), 4, byte(1) & 0xf) : join(byte(2), 4, byte(1) >> 4);
}

}  // namespace

base::Result<base::Image> unpack_pixels(std::span<const std::byte> bytes, int width, int height, std::size_t padding_bytes,
                                        RawFormat format) {
  const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height);
  const bool eight = format == RawFormat::kMono8;
  const std::size_t row_bytes = columns * (eight ? 1 : 2);
  const std::size_t needed = packed(format) ? (rows * columns * 3 + 1) / 2
                             : rows == 0    ? 0
                                            : rows * (row_bytes + padding_bytes) - padding_bytes;
  if (width <= 0 || height <= 0 || bytes.size() < needed) {
    return base::fail(base::ErrorCode::kBadInput,
                      fmt::format("{} bytes are no image of {} x {} px, which takes {}", bytes.size(), width, height, needed));
  }
  base::Image image(width, height, eight ? 8 : 16);
  if (!eight) image.set_white_level(format == RawFormat::kMono16 ? 65535.0 : 4095.0);
  for (std::size_t y = 0; y < rows; ++y) {
    if (!packed(format)) {
      std::memcpy(image.row<std::byte>(0) + y * row_bytes, bytes.data() + y * (row_bytes + padding_bytes), row_bytes);
      continue;
    }
    auto* row = image.row<std::uint16_t>(static_cast<int>(y));
    for (std::size_t x = 0; x < columns; ++x) row[x] = packed_sample(bytes, y * columns + x, format);
  }
  return image;
}

}  // namespace crosstie::devices::detail
