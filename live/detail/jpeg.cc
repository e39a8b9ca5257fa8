#include "live/detail/jpeg.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>  // jpeglib.h needs it first
#include <memory>

#include <fmt/format.h>
#include <jpeglib.h>

namespace crosstie::live::detail {
namespace {

/// libjpeg ends a coding through its error manager, which must not return; longjmp is its documented way out. Nothing with a
/// destructor is created between setjmp and longjmp.
struct ErrorManager {
  jpeg_error_mgr base;
  std::jmp_buf escape;
  char message[JMSG_LENGTH_MAX];
};

[[noreturn]] void give_up(j_common_ptr encoder) {
  auto* manager = reinterpret_cast<ErrorManager*>(encoder->err);
  manager->base.format_message(encoder, manager->message);
  std::longjmp(manager->escape, 1);
}

/// Bytes that no file of this size exceeds (tjBufSize of TurboJPEG for chrominance at half the resolution): with a buffer of them the
/// encoder never allocates one of its own.
std::size_t most_bytes(int width, int height) {
  const auto padded = [](int size) { return (static_cast<std::size_t>(size) + 15) / 16 * 16; };
  return 3 * padded(width) * padded(height) + 2048;
}

struct Output {
  unsigned char* bytes = nullptr;
  unsigned long count = 0;  ///< first of the buffer, then of the file
};

/// False with a message in `manager` where it fails. `encoded` is to be freed in either case.
bool encode(const unsigned char* rgb, JDIMENSION width, JDIMENSION height, int quality, ErrorManager& manager, Output& output) {
  jpeg_compress_struct encoder{};
  encoder.err = jpeg_std_error(&manager.base);
  manager.base.error_exit = give_up;
  if (setjmp(manager.escape) != 0) {
    jpeg_destroy_compress(&encoder);
    return false;
  }
  jpeg_create_compress(&encoder);
  jpeg_mem_dest(&encoder, &output.bytes, &output.count);
  encoder.image_width = width;
  encoder.image_height = height;
  encoder.input_components = 3;
  encoder.in_color_space = JCS_RGB;
  jpeg_set_defaults(&encoder);
  jpeg_set_quality(&encoder, quality, TRUE);
  encoder.dct_method = JDCT_ISLOW;
  jpeg_start_compress(&encoder, TRUE);
  const std::size_t stride = 3 * static_cast<std::size_t>(width);
  while (encoder.next_scanline < height) {
    auto* row = const_cast<unsigned char*>(rgb + encoder.next_scanline * stride);  // it is only read
    jpeg_write_scanlines(&encoder, &row, 1);
  }
  jpeg_finish_compress(&encoder);
  jpeg_destroy_compress(&encoder);
  return true;
}

}  // namespace

base::Result<std::string> encode_jpeg(const base::ColourImage& picture, int quality) {
  if (picture.width <= 0 || picture.height <= 0 || quality < 1 || quality > 100) {
    return base::fail(base::ErrorCode::kUsage,
                      fmt::format("a JPEG of {} x {} px of quality {}; 1 to 100 of a picture that is none", picture.width,
                                  picture.height, quality));
  }
  const std::size_t most = most_bytes(picture.width, picture.height);
  const std::unique_ptr<unsigned char[]> buffer(new unsigned char[most]);  // not set to 0, unlike a string's
  ErrorManager manager{};
  Output output{buffer.get(), static_cast<unsigned long>(most)};
  if (!encode(picture.rgb.data(), static_cast<JDIMENSION>(picture.width), static_cast<JDIMENSION>(picture.height), quality,
              manager, output)) {
    return base::fail(base::ErrorCode::kInternal, fmt::format("a picture was not coded: {}", manager.message));
  }
  return std::string(reinterpret_cast<const char*>(output.bytes), output.count);
}

}  // namespace crosstie::live::detail
