#include <csetjmp>
#include <cstdio>  // jpeglib.h needs it first
#include <new>

#include <jpeglib.h>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

/// libjpeg ends a decoding through its error manager, which must not return; longjmp is its documented way out. Nothing with a
/// destructor is created between setjmp and longjmp.
struct ErrorManager {
  jpeg_error_mgr base;
  std::jmp_buf escape;
  char message[JMSG_LENGTH_MAX];
};

[[noreturn]] void give_up(j_common_ptr decoder) {
  auto* manager = reinterpret_cast<ErrorManager*>(decoder->err);
  manager->base.format_message(decoder, manager->message);
  std::longjmp(manager->escape, 1);
}

/// Level -1 is a warning: the data is damaged and libjpeg would fill in something. The others trace what it does.
void treat_message(j_common_ptr decoder, int level) {
  if (level < 0) give_up(decoder);
}

/// Scans of a progressive file. Default: encoders write some ten; each costs a pass over all blocks and may take as little as twelve bytes,
/// so that without a limit a file of some megabytes keeps the decoder busy for minutes.
constexpr int kMaxScans = 100;

void limit_scans(j_common_ptr decoder) {
  if (reinterpret_cast<j_decompress_ptr>(decoder)->input_scan_number <= kMaxScans) return;
  auto* manager = reinterpret_cast<ErrorManager*>(decoder->err);
  std::snprintf(manager->message, sizeof manager->message, "it has more than %d scans", kMaxScans);
  std::longjmp(manager->escape, 1);
}

/// Decodes to rows of `stride` bytes. False with a message in `manager` where the data is not flawless.
bool decode(std::string_view bytes, ErrorManager& manager, unsigned char* pixels, JDIMENSION width, JDIMENSION height) {
  jpeg_decompress_struct decoder{};
  jpeg_progress_mgr progress{};
  progress.progress_monitor = limit_scans;
  decoder.err = jpeg_std_error(&manager.base);
  manager.base.error_exit = give_up;
  manager.base.emit_message = treat_message;
  if (setjmp(manager.escape) != 0) {
    jpeg_destroy_decompress(&decoder);
    return false;
  }
  jpeg_create_decompress(&decoder);
  decoder.progress = &progress;
  jpeg_mem_src(&decoder, reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<unsigned long>(bytes.size()));
  jpeg_read_header(&decoder, TRUE);
  decoder.out_color_space = JCS_GRAYSCALE;
  decoder.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&decoder);
  if (decoder.output_width != width || decoder.output_height != height || decoder.output_components != 1) {
    std::snprintf(manager.message, sizeof manager.message, "its size is not the one its header states");
    jpeg_destroy_decompress(&decoder);
    return false;
  }
  while (decoder.output_scanline < height) {
    JSAMPROW row = pixels + static_cast<std::size_t>(decoder.output_scanline) * width;
    jpeg_read_scanlines(&decoder, &row, 1);
  }
  jpeg_finish_decompress(&decoder);  // reads on to the end-of-image marker
  jpeg_destroy_decompress(&decoder);
  return true;
}

}  // namespace

Decoded<ImageHeader> read_jpeg_header(std::string_view bytes) {
  // ISO/IEC 10918-1, annex B: segments of a marker and a length, until a start of frame.
  std::size_t at = 2;
  while (at + 4 <= bytes.size()) {
    if (byte_at(bytes, at) != 0xFF) return undecodable("the file is damaged: a JPEG marker is missing");
    const std::uint8_t marker = byte_at(bytes, at + 1);
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame) {
      if (at + 9 > bytes.size()) break;
      return image_header(ImageFormat::kJpeg, big16(bytes, at + 7), big16(bytes, at + 5), byte_at(bytes, at + 4));
    }
    if (marker == 0xDA || marker == 0xD9) return undecodable("the file is damaged: a JPEG without a frame");
    const std::size_t length = big16(bytes, at + 2);
    if (length < 2) return undecodable("the file is damaged: a JPEG segment without a length");
    at += 2 + length;
  }
  return undecodable(kCutOff);
}

Decoded<Image> decode_jpeg(std::string_view bytes, const ImageHeader& header) {
  if (header.info.bits != 8) return undecodable("a JPEG that has not 8 bits");
  // A decoder that runs out of data invents an end of image; the warning about it is caught, but the marker costs nothing to
  // see.
  if (bytes.rfind("\xff\xd9") == std::string_view::npos)
    return undecodable("the file is cut off: it has no end-of-image marker");
  Image image(header.info.width, header.info.height, 8);
  ErrorManager manager{};
  if (!decode(bytes, manager, image.row<unsigned char>(0), static_cast<JDIMENSION>(header.info.width),
              static_cast<JDIMENSION>(header.info.height))) {
    return undecodable("the file is damaged: " + std::string(manager.message));
  }
  return image;
}

}  // namespace crosstie::base::detail
