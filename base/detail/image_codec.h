#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <tl/expected.hpp>

#include "base/image.h"

namespace crosstie::base::detail {

enum class ImageFormat { kPng, kTiff, kBmp, kPgm, kJpeg };

struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  ImageInfo info;
  std::size_t data_offset = 0;  ///< of the pixels: BMP and PGM
  std::size_t data_bytes = 0;   ///< that the header asks for: BMP and PGM, uncompressed
};

/// The error is the reason, for people, without the file's name.
template <typename T>
using Decoded = tl::expected<T, std::string>;

/// Format, size and depth from the first bytes; nothing of the size that the header claims is allocated.
Decoded<ImageHeader> read_header(std::string_view bytes);
Decoded<ImageHeader> read_tiff_header(std::string_view bytes);
Decoded<ImageHeader> read_jpeg_header(std::string_view bytes);

/// Whether the container is whole: sizes against the header, check sums, end marks; what decoders let pass in silence.
Decoded<bool> check_whole(std::string_view bytes, const ImageHeader& header);
Decoded<bool> check_tiff_whole(std::string_view bytes);

/// Decodes to grey levels. The size that comes out must be the header's.
Decoded<Image> decode_with_opencv(std::string_view bytes, const ImageHeader& header);
/// Any warning of the decoder is an error: it means that data was damaged and made up for.
Decoded<Image> decode_jpeg(std::string_view bytes, const ImageHeader& header);

Decoded<std::string> encode_png(const ImageView& image);
Decoded<std::string> encode_png(const ColourImage& image);

}  // namespace crosstie::base::detail
