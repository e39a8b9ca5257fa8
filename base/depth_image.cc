// TIFF 6.0 (Adobe, 1992): header, pixels, one directory of twelve-byte entries sorted by tag.
#include "base/depth_image.h"

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::base {
namespace {

static_assert(std::endian::native == std::endian::little);

void put16(std::string& bytes, std::uint16_t value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); }
void put32(std::string& bytes, std::uint32_t value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); }

void put_entry(std::string& bytes, std::uint16_t tag, std::uint32_t value) {
  constexpr std::uint16_t kLong = 4;
  put16(bytes, tag);
  put16(bytes, kLong);
  put32(bytes, 1);
  put32(bytes, value);
}

}  // namespace

Result<> write_depth_tiff(const std::filesystem::path& path, int width, int height, std::span<const float> values) {
  constexpr std::uint32_t kHeader = 8;
  constexpr std::uint32_t kFloat = 3;
  if (values.size_bytes() > 0xFFFFFF00U) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {} x {} px do not fit into a TIFF", shown(path), width, height));
  }
  const auto size = static_cast<std::uint32_t>(values.size_bytes());
  std::string bytes = "II";
  bytes.reserve(size + 256U);
  put16(bytes, 42);
  put32(bytes, kHeader + size);
  bytes.append(reinterpret_cast<const char*>(values.data()), size);
  const std::array<std::pair<std::uint16_t, std::uint32_t>, 10> entries = {{
      {std::uint16_t{256}, static_cast<std::uint32_t>(width)},   // ImageWidth
      {std::uint16_t{257}, static_cast<std::uint32_t>(height)},  // ImageLength
      {std::uint16_t{258}, 32U},                                 // BitsPerSample
      {std::uint16_t{259}, 1U},                                  // Compression: none
      {std::uint16_t{262}, 1U},                                  // PhotometricInterpretation: larger is brighter
      {std::uint16_t{273}, kHeader},                             // StripOffsets
      {std::uint16_t{277}, 1U},                                  // SamplesPerPixel
      {std::uint16_t{278}, static_cast<std::uint32_t>(height)},  // RowsPerStrip
      {std::uint16_t{279}, size},                                // StripByteCounts
      {std::uint16_t{339}, kFloat},                              // SampleFormat
  }};
  put16(bytes, static_cast<std::uint16_t>(entries.size()));
  for (const auto& [tag, value] : entries) put_entry(bytes, tag, value);
  put32(bytes, 0);
  return write_file_atomically(path, bytes);
}

}  // namespace crosstie::base
