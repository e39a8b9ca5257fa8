#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <tiffio.h>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

constexpr tmsize_t kMaxAllocation = tmsize_t{4} << 30;

/// The file in memory, and what libtiff says of it.
struct Memory {
  std::string_view bytes;
  toff_t position = 0;
  std::string message;
};

tmsize_t read_bytes(thandle_t handle, void* out, tmsize_t size) {
  auto* memory = static_cast<Memory*>(handle);
  const toff_t left = memory->position < memory->bytes.size() ? memory->bytes.size() - memory->position : 0;
  const auto count = static_cast<std::size_t>(std::min<toff_t>(left, static_cast<toff_t>(size)));
  if (count > 0) std::memcpy(out, memory->bytes.data() + memory->position, count);
  memory->position += count;
  return static_cast<tmsize_t>(count);
}
tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }
toff_t seek(thandle_t handle, toff_t offset, int whence) {
  auto* memory = static_cast<Memory*>(handle);
  if (whence == SEEK_CUR) offset += memory->position;
  if (whence == SEEK_END) offset += memory->bytes.size();
  return memory->position = offset;
}
int close_nothing(thandle_t) { return 0; }
toff_t size_of_file(thandle_t handle) { return static_cast<Memory*>(handle)->bytes.size(); }

int keep_error(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  auto* memory = static_cast<Memory*>(user);
  char text[200] = {};
  std::vsnprintf(text, sizeof text, format, arguments);
  if (memory->message.empty()) memory->message = text;
  return 1;  // said: not printed
}
int ignore_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

using TiffFile = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

TiffFile open(Memory& memory) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_error, &memory);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore_warning, &memory);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxAllocation);
  // "m": no mapping of memory, for there is none to map.
  return {TIFFClientOpenExt("", "rm", &memory, read_bytes, write_nothing, seek, close_nothing, size_of_file, nullptr, nullptr,
                            options.get()),
          TIFFClose};
}

/// What of a TIFF's tags says how its samples lie.
struct Layout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint16_t bits = 1;
  std::uint16_t samples = 1;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK;
  std::uint16_t* palette[3] = {};
  bool tiled = false;
  std::uint32_t block_width = 0;  ///< of a strip or tile
  std::uint32_t block_height = 0;
};

Decoded<Layout> layout_of(TIFF* tiff) {
  Layout layout;
  std::uint16_t planar = PLANARCONFIG_CONTIG;
  std::uint16_t format = SAMPLEFORMAT_UINT;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &layout.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &layout.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &layout.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &layout.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planar);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &format);
  if (TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &layout.photometric) != 1) {
    return undecodable("a TIFF that does not say what its samples mean");
  }
  const bool grey = layout.photometric == PHOTOMETRIC_MINISBLACK || layout.photometric == PHOTOMETRIC_MINISWHITE;
  const bool rgb = layout.photometric == PHOTOMETRIC_RGB && layout.samples >= 3;
  const bool palette = layout.photometric == PHOTOMETRIC_PALETTE && layout.bits <= 8 &&
                       TIFFGetField(tiff, TIFFTAG_COLORMAP, &layout.palette[0], &layout.palette[1], &layout.palette[2]) == 1;
  if (!grey && !rgb && !palette) {
    return undecodable(fmt::format("a TIFF of photometric interpretation {}, which is not read", layout.photometric));
  }
  if (layout.bits < 1 || layout.bits > 16 || layout.samples < 1 || layout.samples > 4 || format != SAMPLEFORMAT_UINT ||
      (planar != PLANARCONFIG_CONTIG && layout.samples > 1)) {
    return undecodable(fmt::format("a TIFF of {} samples of {} bits, a layout that is not read", layout.samples, layout.bits));
  }
  layout.tiled = TIFFIsTiled(tiff) != 0;
  if (layout.tiled) {
    TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &layout.block_width);
    TIFFGetField(tiff, TIFFTAG_TILELENGTH, &layout.block_height);
  } else {
    layout.block_width = layout.width;
    layout.block_height = layout.height;
    TIFFGetField(tiff, TIFFTAG_ROWSPERSTRIP, &layout.block_height);
    layout.block_height = std::min(layout.block_height, layout.height);
  }
  if (layout.block_width == 0 || layout.block_height == 0) return undecodable("a TIFF with empty strips");
  return layout;
}

/// Every strip or tile must lie inside of the file, and uncompressed ones must be long enough: libtiff reads on otherwise.
Decoded<bool> check_blocks(TIFF* tiff, const Layout& layout, std::size_t file_bytes) {
  std::uint16_t compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &compression);
  const std::uint32_t count = layout.tiled ? TIFFNumberOfTiles(tiff) : TIFFNumberOfStrips(tiff);
  const std::uint64_t row_bytes = (std::uint64_t{layout.block_width} * layout.bits * layout.samples + 7) / 8;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t offset = TIFFGetStrileOffset(tiff, i);
    const std::uint64_t size = TIFFGetStrileByteCount(tiff, i);
    if (offset == 0 || size == 0 || offset > file_bytes || size > file_bytes - offset) return undecodable(kCutOff);
    const std::uint64_t rows =
        layout.tiled ? layout.block_height
                     : std::min<std::uint64_t>(layout.block_height, layout.height - std::uint64_t{i} * layout.block_height);
    if (compression == COMPRESSION_NONE && size < row_bytes * rows) {
      return undecodable("the file is damaged: a strip holds less than its rows");
    }
  }
  return true;
}

/// The samples of one row of a block, unpacked, as grey levels.
class RowReader {
 public:
  explicit RowReader(const Layout& layout)
      : layout_(layout), scale_(layout.bits < 8 ? 255U / ((1U << layout.bits) - 1U) : 1U) {}

  [[nodiscard]] std::uint16_t grey(const std::uint8_t* row, std::uint32_t x) const {
    const std::size_t first = std::size_t{x} * layout_.samples;
    const std::uint32_t value = sample(row, first);
    switch (layout_.photometric) {
      case PHOTOMETRIC_RGB:
        return static_cast<std::uint16_t>(scale_ * luminance(value, sample(row, first + 1), sample(row, first + 2)));
      case PHOTOMETRIC_PALETTE:
        return luminance(entry(0, value), entry(1, value), entry(2, value));
      case PHOTOMETRIC_MINISWHITE:
        return static_cast<std::uint16_t>(scale_ * ((1U << layout_.bits) - 1U - value));
      default:
        return static_cast<std::uint16_t>(scale_ * value);
    }
  }

 private:
  [[nodiscard]] std::uint32_t sample(const std::uint8_t* row, std::size_t index) const {
    if (layout_.bits == 8) return row[index];
    if (layout_.bits == 16) {
      std::uint16_t value = 0;  // libtiff has put the bytes into this machine's order
      std::memcpy(&value, row + 2 * index, sizeof value);
      return value;
    }
    std::uint32_t value = 0;
    for (std::size_t bit = index * layout_.bits; bit < (index + 1) * layout_.bits; ++bit) {
      value = value << 1 | ((row[bit / 8] >> (7 - bit % 8)) & 1U);
    }
    return value;
  }
  /// Of the palette, whose entries have 16 bits.
  [[nodiscard]] std::uint16_t entry(int colour, std::uint32_t value) const {
    return static_cast<std::uint16_t>(layout_.palette[colour][value] >> 8);
  }

  const Layout& layout_;
  std::uint32_t scale_;
};

template <typename Sample>
bool read_blocks(TIFF* tiff, const Layout& layout, Image& image) {
  const std::size_t block_bytes = static_cast<std::size_t>(layout.tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff));
  const std::size_t row_bytes = static_cast<std::size_t>(layout.tiled ? TIFFTileRowSize(tiff) : TIFFScanlineSize(tiff));
  if (row_bytes == 0 || block_bytes < row_bytes * layout.block_height) return false;
  std::vector<std::uint8_t> block(block_bytes);
  const RowReader reader(layout);
  const std::uint32_t across = (layout.width + layout.block_width - 1) / layout.block_width;
  const std::uint32_t down = (layout.height + layout.block_height - 1) / layout.block_height;
  for (std::uint32_t i = 0; i < across * down; ++i) {
    const std::uint32_t x0 = i % across * layout.block_width;
    const std::uint32_t y0 = i / across * layout.block_height;
    const std::uint32_t columns = std::min(layout.block_width, layout.width - x0);
    const std::uint32_t rows = std::min(layout.block_height, layout.height - y0);
    const tmsize_t got = layout.tiled ? TIFFReadEncodedTile(tiff, i, block.data(), static_cast<tmsize_t>(block_bytes))
                                      : TIFFReadEncodedStrip(tiff, i, block.data(), static_cast<tmsize_t>(rows * row_bytes));
    if (got < static_cast<tmsize_t>(rows * row_bytes)) return false;
    for (std::uint32_t y = 0; y < rows; ++y) {
      Sample* out = image.row<Sample>(static_cast<int>(y0 + y)) + x0;
      for (std::uint32_t x = 0; x < columns; ++x) out[x] = static_cast<Sample>(reader.grey(block.data() + y * row_bytes, x));
    }
  }
  return true;
}

}  // namespace

Decoded<ImageHeader> read_tiff_header(std::string_view bytes) {
  Memory memory{bytes, 0, {}};
  const TiffFile tiff = open(memory);
  if (tiff == nullptr) return undecodable("a TIFF whose directory cannot be read: it is cut off or damaged");
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint16_t bits = 1;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_BITSPERSAMPLE, &bits);
  return image_header(ImageFormat::kTiff, width, height, bits);
}

Decoded<Image> decode_tiff(std::string_view bytes, const ImageHeader& header) {
  Memory memory{bytes, 0, {}};
  const TiffFile tiff = open(memory);
  if (tiff == nullptr) return undecodable("a TIFF whose directory cannot be read: it is cut off or damaged");
  auto layout = layout_of(tiff.get());
  if (!layout) return undecodable(layout.error());
  if (auto whole = check_blocks(tiff.get(), *layout, bytes.size()); !whole) return undecodable(whole.error());
  Image image(header.info.width, header.info.height, layout->bits > 8 ? 16 : 8);
  if (layout->bits > 8) image.set_white_level(static_cast<double>((1U << layout->bits) - 1U));
  const bool good = layout->bits > 8 ? read_blocks<std::uint16_t>(tiff.get(), *layout, image)
                                     : read_blocks<std::uint8_t>(tiff.get(), *layout, image);
  if (!good || !memory.message.empty()) {
    return undecodable(
        fmt::format("the file is damaged: {}", memory.message.empty() ? "a strip is too short" : memory.message));
  }
  return image;
}

}  // namespace crosstie::base::detail
