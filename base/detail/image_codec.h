#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

#include "base/image.h"

namespace crosstie::base::detail {

enum class ImageFormat { kPng, kTiff, kBmp, kPnm, kJpeg };

/// What the first bytes of an image file say.
struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  ImageInfo info;
};

/// The error is the reason, for people, without the file's name.
template <typename T>
using Decoded = tl::expected<T, std::string>;

[[nodiscard]] inline tl::unexpected<std::string> undecodable(std::string_view reason) {
  return tl::unexpected<std::string>(std::string(reason));
}
inline constexpr std::string_view kCutOff = "the file is cut off";

/// A header with the size checked to be positive and representable.
Decoded<ImageHeader> image_header(ImageFormat format, std::uint64_t width, std::uint64_t height, int bits);

/// Format, size and depth; nothing of the size that the header claims is allocated.
Decoded<ImageHeader> read_header(std::string_view bytes);
Decoded<ImageHeader> read_png_header(std::string_view bytes);
Decoded<ImageHeader> read_tiff_header(std::string_view bytes);
Decoded<ImageHeader> read_bmp_header(std::string_view bytes);
Decoded<ImageHeader> read_pnm_header(std::string_view bytes);
Decoded<ImageHeader> read_jpeg_header(std::string_view bytes);

/// The pixels as grey levels. Each first makes sure that the container is whole; what comes out has the header's size.
Decoded<Image> decode(std::string_view bytes, const ImageHeader& header);
Decoded<Image> decode_png(std::string_view bytes, const ImageHeader& header);
Decoded<Image> decode_tiff(std::string_view bytes, const ImageHeader& header);
Decoded<Image> decode_bmp(std::string_view bytes, const ImageHeader& header);
Decoded<Image> decode_pnm(std::string_view bytes, const ImageHeader& header);
Decoded<Image> decode_jpeg(std::string_view bytes, const ImageHeader& header);

Decoded<std::string> encode_png(const ImageView& image);
Decoded<std::string> encode_png(const ColourImage& image);

/// Luminance after ITU-R BT.601, rounded.
template <typename Sample>
[[nodiscard]] Sample luminance(Sample red, Sample green, Sample blue) {
  return static_cast<Sample>((299U * red + 587U * green + 114U * blue + 500U) / 1000U);
}

}  // namespace crosstie::base::detail
