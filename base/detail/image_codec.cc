#include "base/detail/image_codec.h"

#include <limits>

#include <fmt/format.h>

namespace crosstie::base::detail {

Decoded<ImageHeader> image_header(ImageFormat format, std::uint64_t width, std::uint64_t height, int bits) {
  constexpr std::uint64_t kLargest = std::numeric_limits<int>::max();
  if (width == 0 || height == 0 || width > kLargest || height > kLargest) {
    return undecodable(fmt::format("its header claims {} x {} pixels", width, height));
  }
  return ImageHeader{format, {static_cast<int>(width), static_cast<int>(height), bits}};
}

Decoded<ImageHeader> read_header(std::string_view bytes) {
  if (bytes.empty()) return undecodable("the file is empty");
  if (bytes.starts_with(std::string_view("\x89PNG\r\n\x1a\n", 8))) return read_png_header(bytes);
  if (bytes.starts_with("\xff\xd8\xff")) return read_jpeg_header(bytes);
  if (bytes.starts_with(std::string_view("II*\0", 4)) || bytes.starts_with(std::string_view("MM\0*", 4))) {
    return read_tiff_header(bytes);
  }
  if (bytes.starts_with("BM")) return read_bmp_header(bytes);
  if (bytes.size() > 2 && bytes[0] == 'P' && std::string_view("2356").find(bytes[1]) != std::string_view::npos) {
    return read_pnm_header(bytes);
  }
  return undecodable("no image of a known format (PNG, TIFF, BMP, PGM or JPEG)");
}

Decoded<Image> decode(std::string_view bytes, const ImageHeader& header) {
  switch (header.format) {
    case ImageFormat::kPng:
      return decode_png(bytes, header);
    case ImageFormat::kTiff:
      return decode_tiff(bytes, header);
    case ImageFormat::kBmp:
      return decode_bmp(bytes, header);
    case ImageFormat::kPnm:
      return decode_pnm(bytes, header);
    case ImageFormat::kJpeg:
      return decode_jpeg(bytes, header);
  }
  return undecodable("no image of a known format");
}

}  // namespace crosstie::base::detail
