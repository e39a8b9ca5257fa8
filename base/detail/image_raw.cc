// The uncompressed formats: BMP and PGM/PPM.
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

struct BmpLayout {
  std::int32_t width = 0;
  std::int32_t height = 0;  ///< negative: the first row comes first
  std::uint32_t bits = 0;
  std::size_t palette_offset = 0;
  std::size_t palette_size = 0;
  std::size_t data_offset = 0;

  [[nodiscard]] std::size_t row_bytes() const { return (static_cast<std::size_t>(width) * bits + 31) / 32 * 4; }
};

Decoded<BmpLayout> bmp_layout(std::string_view bytes) {
  if (bytes.size() < 54) return undecodable(kCutOff);
  BmpLayout layout;
  const std::uint32_t header_bytes = little32(bytes, 14);
  layout.width = static_cast<std::int32_t>(little32(bytes, 18));
  layout.height = static_cast<std::int32_t>(little32(bytes, 22));
  layout.bits = little16(bytes, 28);
  layout.data_offset = little32(bytes, 10);
  if (header_bytes < 40 || header_bytes > 256 || layout.width <= 0 || layout.height == 0 ||
      layout.height == std::numeric_limits<std::int32_t>::min()) {
    return undecodable("a BMP with a header that cannot be read");
  }
  const bool known_depth = layout.bits == 1 || layout.bits == 4 || layout.bits == 8 || layout.bits == 24 || layout.bits == 32;
  if (little32(bytes, 30) != 0 || !known_depth) return undecodable("a BMP that is compressed or of a depth that is not read");
  layout.palette_offset = 14 + header_bytes;
  if (layout.bits <= 8) {
    const std::uint32_t largest = 1U << layout.bits;
    const std::uint32_t colours = little32(bytes, 46);
    if (colours > largest) return undecodable("a BMP with a header that cannot be read");
    layout.palette_size = colours == 0 ? largest : colours;
  }
  if (layout.data_offset < layout.palette_offset + 4 * layout.palette_size) {
    return undecodable("a BMP with a header that cannot be read");
  }
  return layout;
}

/// Reads the numbers of a PNM's text: blanks and comments lie between them.
class PnmText {
 public:
  PnmText(std::string_view bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  /// The next number; -1 where there is none or it is too large.
  std::int64_t next() {
    for (; at_ < bytes_.size(); ++at_) {
      const char c = bytes_[at_];
      if (c == '#') {
        at_ = std::min(bytes_.find('\n', at_), bytes_.size() - 1);
      } else if (c != ' ' && c != '\t' && c != '\r' && c != '\n') {
        break;
      }
    }
    std::int64_t value = -1;
    for (; at_ < bytes_.size() && bytes_[at_] >= '0' && bytes_[at_] <= '9'; ++at_) {
      value = 10 * std::max<std::int64_t>(value, 0) + (bytes_[at_] - '0');
      if (value > std::numeric_limits<std::int32_t>::max()) return -1;
    }
    return value;
  }
  [[nodiscard]] std::size_t position() const { return at_; }

 private:
  std::string_view bytes_;
  std::size_t at_;
};

struct PnmLayout {
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::int64_t white = 0;
  bool binary = false;
  std::size_t channels = 1;
  std::size_t data_offset = 0;  ///< binary: of the samples; text: behind the largest value

  [[nodiscard]] std::size_t samples() const { return static_cast<std::size_t>(width * height) * channels; }
};

Decoded<PnmLayout> pnm_layout(std::string_view bytes) {
  PnmLayout layout;
  layout.binary = bytes[1] == '5' || bytes[1] == '6';
  layout.channels = bytes[1] == '3' || bytes[1] == '6' ? 3 : 1;
  PnmText text(bytes, 2);
  for (std::int64_t* value : {&layout.width, &layout.height, &layout.white}) *value = text.next();
  if (text.position() >= bytes.size()) return undecodable(kCutOff);
  if (layout.width < 1 || layout.height < 1 || layout.white < 1 || layout.white > 65535) {
    return undecodable("a PGM with a header that cannot be read");
  }
  layout.data_offset = text.position() + (layout.binary ? 1 : 0);
  return layout;
}

template <typename Sample, typename Next>
void fill_pnm(const PnmLayout& layout, Image& image, Next next) {
  for (int y = 0; y < image.height(); ++y) {
    Sample* out = image.row<Sample>(y);
    for (int x = 0; x < image.width(); ++x) {
      const auto first = static_cast<Sample>(next());
      if (layout.channels == 1) {
        out[x] = first;
        continue;
      }
      const auto second = static_cast<Sample>(next());
      const auto third = static_cast<Sample>(next());
      out[x] = luminance(first, second, third);
    }
  }
}

}  // namespace

Decoded<ImageHeader> read_bmp_header(std::string_view bytes) {
  const auto layout = bmp_layout(bytes);
  if (!layout) return undecodable(layout.error());
  return image_header(ImageFormat::kBmp, static_cast<std::uint64_t>(layout->width),
                      static_cast<std::uint64_t>(std::abs(layout->height)), 8);
}

Decoded<Image> decode_bmp(std::string_view bytes, const ImageHeader& header) {
  const auto layout = bmp_layout(bytes);
  if (!layout) return undecodable(layout.error());
  const std::size_t row_bytes = layout->row_bytes();
  const auto height = static_cast<std::size_t>(header.info.height);
  if (layout->data_offset > bytes.size() || row_bytes * height > bytes.size() - layout->data_offset)
    return undecodable(kCutOff);
  // Colours are stored as blue, green, red.
  const auto grey_at = [&](std::size_t at) {
    return luminance(byte_at(bytes, at + 2), byte_at(bytes, at + 1), byte_at(bytes, at));
  };
  Image image(header.info.width, header.info.height, 8);
  for (std::size_t y = 0; y < height; ++y) {
    const std::size_t row = layout->data_offset + (layout->height > 0 ? height - 1 - y : y) * row_bytes;
    auto* out = image.row<std::uint8_t>(static_cast<int>(y));
    for (std::size_t x = 0; x < static_cast<std::size_t>(layout->width); ++x) {
      if (layout->bits >= 24) {
        out[x] = grey_at(row + x * (layout->bits / 8));
        continue;
      }
      const std::size_t bit = x * layout->bits;
      const std::size_t index = (byte_at(bytes, row + bit / 8) >> (8 - layout->bits - bit % 8)) & ((1U << layout->bits) - 1U);
      if (index >= layout->palette_size) return undecodable("the file is damaged: a colour outside of its palette");
      out[x] = grey_at(layout->palette_offset + 4 * index);
    }
  }
  return image;
}

Decoded<ImageHeader> read_pnm_header(std::string_view bytes) {
  const auto layout = pnm_layout(bytes);
  if (!layout) return undecodable(layout.error());
  return image_header(ImageFormat::kPnm, static_cast<std::uint64_t>(layout->width), static_cast<std::uint64_t>(layout->height),
                      layout->white > 255 ? 16 : 8);
}

Decoded<Image> decode_pnm(std::string_view bytes, const ImageHeader& header) {
  const auto layout = pnm_layout(bytes);
  if (!layout) return undecodable(layout.error());
  const auto sample_bytes = static_cast<std::size_t>(header.info.bits / 8);
  // In text, a sample has a digit and a blank at least, the last one only the digit.
  const std::size_t least = layout->binary ? layout->samples() * sample_bytes : 2 * layout->samples() - 1;
  if (bytes.size() < layout->data_offset || bytes.size() - layout->data_offset < least) return undecodable(kCutOff);
  Image image(header.info.width, header.info.height, header.info.bits);
  image.set_white_level(static_cast<double>(layout->white));
  bool good = true;
  std::size_t at = layout->data_offset;
  PnmText text(bytes, at);
  const auto next = [&]() -> std::int64_t {
    std::int64_t value = 0;
    if (!layout->binary) {
      value = text.next();
    } else {
      value = sample_bytes == 2 ? big16(bytes, at) : byte_at(bytes, at);
      at += sample_bytes;
    }
    good = good && value >= 0 && value <= layout->white;
    return value;
  };
  if (header.info.bits == 16)
    fill_pnm<std::uint16_t>(*layout, image, next);
  else
    fill_pnm<std::uint8_t>(*layout, image, next);
  if (!good) return undecodable("the file is damaged: a sample is missing or above the largest value that its header states");
  return image;
}

}  // namespace crosstie::base::detail
