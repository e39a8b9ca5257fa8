#include <array>
#include <csetjmp>
#include <cstdint>
#include <cstring>

#include <png.h>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

constexpr std::size_t kSignatureBytes = 8;
/// Deflate gains little on the noise of photographs; this level is three times as fast as the default.
constexpr int kCompressionLevel = 3;

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

/// All chunks to the last, with their check sums: the decoder ignores those of some, and what follows the pixels.
Decoded<bool> check_chunks(std::string_view bytes) {
  for (std::size_t at = kSignatureBytes;;) {
    if (bytes.size() - at < 12) return undecodable(kCutOff);
    const std::size_t length = big32(bytes, at);
    if (length > bytes.size() - at - 12) return undecodable(kCutOff);
    if (crc32(bytes.substr(at + 4, length + 4)) != big32(bytes, at + 8 + length)) {
      return undecodable("the file is damaged: a check sum is wrong");
    }
    if (bytes.substr(at + 4, 4) == "IEND") return true;
    at += length + 12;
  }
}

/// What libpng's callbacks need: the bytes still to be read or already written, and the way out of an error, which is longjmp
/// by libpng's design. Nothing with a destructor is created between setjmp and longjmp.
struct Context {
  std::string_view input;
  std::string output;
  std::jmp_buf escape;
  char message[160];
};

[[noreturn]] void give_up(png_structp png, png_const_charp message) {
  auto* context = static_cast<Context*>(png_get_error_ptr(png));
  std::strncpy(context->message, message, sizeof context->message - 1);
  std::longjmp(context->escape, 1);
}
void ignore_warning(png_structp, png_const_charp) {}

void take_bytes(png_structp png, png_bytep out, std::size_t size) {
  auto* context = static_cast<Context*>(png_get_io_ptr(png));
  if (context->input.size() < size) png_error(png, "it is cut off");
  std::memcpy(out, context->input.data(), size);
  context->input.remove_prefix(size);
}

void give_bytes(png_structp png, png_bytep in, std::size_t size) {
  static_cast<Context*>(png_get_io_ptr(png))->output.append(reinterpret_cast<const char*>(in), size);
}

/// 8 or 16 bit samples (in this machine's order), 1 channel or 3.
struct Pixels {
  int width = 0;
  int height = 0;
  int channels = 0;
  int bits = 0;
  std::vector<png_byte> samples;
  std::vector<png_bytep> rows;
};

/// Reads up to the pixels and asks for grey or RGB of 8 or 16 bits.
bool begin_read(png_structp png, png_infop info, Context& context, Pixels& pixels) {
  if (setjmp(context.escape) != 0) return false;
  png_set_read_fn(png, &context, take_bytes);
  png_read_info(png, info);
  png_set_palette_to_rgb(png);
  png_set_expand_gray_1_2_4_to_8(png);
  png_set_strip_alpha(png);
  png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  pixels.width = static_cast<int>(png_get_image_width(png, info));
  pixels.height = static_cast<int>(png_get_image_height(png, info));
  pixels.channels = png_get_channels(png, info);
  pixels.bits = png_get_bit_depth(png, info);
  return true;
}

bool read_pixels(png_structp png, Context& context, Pixels& pixels) {
  if (setjmp(context.escape) != 0) return false;
  png_read_image(png, pixels.rows.data());
  return true;
}

template <typename Sample>
void to_grey(const Pixels& pixels, Image& image) {
  const auto width = static_cast<std::size_t>(pixels.width);
  for (int y = 0; y < pixels.height; ++y) {
    const auto* in = reinterpret_cast<const Sample*>(pixels.rows[static_cast<std::size_t>(y)]);
    Sample* out = image.row<Sample>(y);
    for (std::size_t x = 0; x < width; ++x) {
      out[x] = pixels.channels == 1 ? in[x] : luminance(in[3 * x], in[3 * x + 1], in[3 * x + 2]);
    }
  }
}

bool write(png_structp png, png_infop info, Context& context, Pixels& pixels) {
  if (setjmp(context.escape) != 0) return false;
  png_set_write_fn(png, &context, give_bytes, nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(pixels.width), static_cast<png_uint_32>(pixels.height), pixels.bits,
               pixels.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, kCompressionLevel);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_write_info(png, info);
  if (pixels.bits == 16) png_set_swap(png);
  png_write_image(png, pixels.rows.data());
  png_write_end(png, nullptr);
  return true;
}

Decoded<std::string> encode(Pixels& pixels) {
  Context context{};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &context, give_up, ignore_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool good = info != nullptr && write(png, info, context, pixels);
  png_destroy_write_struct(&png, &info);
  if (!good) return undecodable(std::string("the picture cannot be encoded: ") + context.message);
  return std::move(context.output);
}

}  // namespace

Decoded<ImageHeader> read_png_header(std::string_view bytes) {
  // Signature, length of the chunk, "IHDR", width, height, depth.
  if (bytes.size() < 33) return undecodable(kCutOff);
  if (bytes.substr(12, 4) != "IHDR") return undecodable("a PNG without a header");
  return image_header(ImageFormat::kPng, big32(bytes, 16), big32(bytes, 20), byte_at(bytes, 24));
}

Decoded<Image> decode_png(std::string_view bytes, const ImageHeader& header) {
  if (auto whole = check_chunks(bytes); !whole) return undecodable(whole.error());
  Context context{};
  context.input = bytes;
  Pixels pixels;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &context, give_up, ignore_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  bool good = info != nullptr && begin_read(png, info, context, pixels);
  const bool expected = pixels.width == header.info.width && pixels.height == header.info.height &&
                        (pixels.channels == 1 || pixels.channels == 3) && (pixels.bits == 8 || pixels.bits == 16);
  if (good && expected) {
    const std::size_t row_bytes = png_get_rowbytes(png, info);
    pixels.samples.resize(row_bytes * static_cast<std::size_t>(pixels.height));
    for (std::size_t y = 0; y < static_cast<std::size_t>(pixels.height); ++y)
      pixels.rows.push_back(&pixels.samples[y * row_bytes]);
    good = read_pixels(png, context, pixels);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  if (!good || !expected) return undecodable(std::string("the file is damaged: ") + context.message);
  Image image(pixels.width, pixels.height, pixels.bits);
  if (pixels.bits == 16)
    to_grey<std::uint16_t>(pixels, image);
  else
    to_grey<std::uint8_t>(pixels, image);
  return image;
}

Decoded<std::string> encode_png(const ImageView& image) {
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) return undecodable("a picture without pixels");
  Pixels pixels{image.width, image.height, 1, image.bits, {}, {}};
  for (int y = 0; y < image.height; ++y) pixels.rows.push_back(const_cast<png_bytep>(image.row<png_byte>(y)));
  return encode(pixels);
}

Decoded<std::string> encode_png(const ColourImage& image) {
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  if (image.width <= 0 || image.height <= 0 || image.rgb.size() != row_bytes * static_cast<std::size_t>(image.height)) {
    return undecodable("a picture without pixels");
  }
  Pixels pixels{image.width, image.height, 3, 8, {}, {}};
  for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y) {
    pixels.rows.push_back(const_cast<png_bytep>(image.rgb.data() + y * row_bytes));
  }
  return encode(pixels);
}

}  // namespace crosstie::base::detail
