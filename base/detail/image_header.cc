// Headers and wholeness of PNG, BMP and PGM; TIFF and JPEG have files of their own.
#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include <fmt/format.h>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

constexpr std::string_view kPngMagic("\x89PNG\r\n\x1a\n", 8);
constexpr std::string_view kCut = "the file is cut off";

tl::unexpected<std::string> bad(std::string_view reason) { return tl::unexpected<std::string>(std::string(reason)); }

Decoded<ImageHeader> header_of(ImageFormat format, std::uint64_t width, std::uint64_t height, int bits) {
  constexpr std::uint64_t kLargest = std::numeric_limits<int>::max();
  if (width == 0 || height == 0 || width > kLargest || height > kLargest) {
    return bad(fmt::format("its header claims {} x {} pixels", width, height));
  }
  ImageHeader header;
  header.format = format;
  header.info = {static_cast<int>(width), static_cast<int>(height), bits};
  return header;
}

Decoded<ImageHeader> read_png_header(std::string_view bytes) {
  // Signature, length of the chunk, "IHDR", width, height, depth.
  if (bytes.size() < 33) return bad(kCut);
  if (bytes.substr(12, 4) != "IHDR") return bad("a PNG without a header");
  return header_of(ImageFormat::kPng, big32(bytes, 16), big32(bytes, 20), byte_at(bytes, 24));
}

/// CRC-32 of ISO 3309, as PNG uses it.
std::uint32_t crc32(std::string_view bytes) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> result{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int bit = 0; bit < 8; ++bit) c = (c >> 1) ^ ((c & 1) != 0 ? 0xEDB88320U : 0U);
      result[i] = c;
    }
    return result;
  }();
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const char c : bytes) crc = table[(crc ^ static_cast<unsigned char>(c)) & 0xFFU] ^ (crc >> 8);
  return ~crc;
}

Decoded<bool> check_png_whole(std::string_view bytes) {
  for (std::size_t at = kPngMagic.size();;) {
    if (bytes.size() - at < 12) return bad(kCut);
    const std::size_t length = big32(bytes, at);
    if (length > bytes.size() - at - 12) return bad(kCut);
    const std::string_view type = bytes.substr(at + 4, 4);
    if (crc32(bytes.substr(at + 4, length + 4)) != big32(bytes, at + 8 + length)) {
      return bad("the file is damaged: a check sum is wrong");
    }
    if (type == "IEND") return true;
    at += length + 12;
  }
}

Decoded<ImageHeader> read_bmp_header(std::string_view bytes) {
  if (bytes.size() < 54) return bad(kCut);
  const auto width = static_cast<std::int32_t>(little32(bytes, 18));
  const auto height = static_cast<std::int32_t>(little32(bytes, 22));
  const std::uint32_t bits = little16(bytes, 28);
  if (little32(bytes, 14) < 40 || width <= 0 || height == 0 || height == std::numeric_limits<std::int32_t>::min()) {
    return bad("a BMP with a header that cannot be read");
  }
  auto header =
      header_of(ImageFormat::kBmp, static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(std::abs(height)), 8);
  if (!header) return header;
  header->data_offset = little32(bytes, 10);
  const bool uncompressed = little32(bytes, 30) == 0 || little32(bytes, 30) == 3;
  if (uncompressed) {
    header->data_bytes = (static_cast<std::size_t>(width) * bits + 31) / 32 * 4 * static_cast<std::size_t>(std::abs(height));
  }
  return header;
}

/// The header of a PGM (P2, P5) or PPM (P3, P6): magic, width, height, largest value, separated by blanks and comments.
Decoded<ImageHeader> read_pgm_header(std::string_view bytes) {
  std::size_t at = 2;
  std::uint64_t values[3] = {};
  for (std::uint64_t& value : values) {
    for (; at < bytes.size(); ++at) {
      const char c = bytes[at];
      if (c == '#') {
        at = bytes.find('\n', at);
        if (at == std::string_view::npos) return bad(kCut);
      } else if (c != ' ' && c != '\t' && c != '\r' && c != '\n') {
        break;
      }
    }
    const std::size_t start = at;
    for (; at < bytes.size() && bytes[at] >= '0' && bytes[at] <= '9' && at - start < 10; ++at) {
      value = 10 * value + static_cast<std::uint64_t>(bytes[at] - '0');
    }
    if (at == bytes.size()) return bad(kCut);
    if (at == start) return bad("a PGM with a header that cannot be read");
  }
  if (values[2] == 0 || values[2] > 65535) return bad("a PGM with a header that cannot be read");
  auto header = header_of(ImageFormat::kPgm, values[0], values[1], values[2] > 255 ? 16 : 8);
  if (!header) return header;
  header->data_offset = at + 1;
  const bool binary = bytes[1] == '5' || bytes[1] == '6';
  const std::uint64_t samples = values[0] * values[1] * (bytes[1] == '6' || bytes[1] == '3' ? 3 : 1);
  header->data_bytes = binary ? samples * (values[2] > 255 ? 2 : 1) : 2 * samples - 1;  // "0 0 0" at least
  return header;
}

}  // namespace

Decoded<ImageHeader> read_header(std::string_view bytes) {
  if (bytes.empty()) return bad("the file is empty");
  if (bytes.starts_with(kPngMagic)) return read_png_header(bytes);
  if (bytes.starts_with("\xff\xd8\xff")) return read_jpeg_header(bytes);
  if (bytes.starts_with(std::string_view("II*\0", 4)) || bytes.starts_with(std::string_view("MM\0*", 4))) {
    return read_tiff_header(bytes);
  }
  if (bytes.starts_with("BM")) return read_bmp_header(bytes);
  if (bytes.size() > 2 && bytes[0] == 'P' && (bytes[1] == '2' || bytes[1] == '3' || bytes[1] == '5' || bytes[1] == '6')) {
    return read_pgm_header(bytes);
  }
  return bad("no image of a known format (PNG, TIFF, BMP, PGM or JPEG)");
}

Decoded<bool> check_whole(std::string_view bytes, const ImageHeader& header) {
  switch (header.format) {
    case ImageFormat::kPng:
      return check_png_whole(bytes);
    case ImageFormat::kTiff:
      return check_tiff_whole(bytes);
    case ImageFormat::kJpeg:
      return true;  // its decoder's warnings tell
    case ImageFormat::kBmp:
    case ImageFormat::kPgm:
      if (header.data_offset > bytes.size() || header.data_bytes > bytes.size() - header.data_offset) return bad(kCut);
      return true;
  }
  return true;
}

}  // namespace crosstie::base::detail
