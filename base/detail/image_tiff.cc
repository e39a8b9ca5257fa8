// The first directory of a TIFF (TIFF 6.0, section 2): enough to know its size and whether its strips or tiles are all there.
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/detail/byte_order.h"
#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

enum Tag : std::uint16_t {
  kWidth = 256,
  kHeight = 257,
  kBitsPerSample = 258,
  kCompression = 259,
  kStripOffsets = 273,
  kSamplesPerPixel = 277,
  kStripByteCounts = 279,
  kTileOffsets = 324,
  kTileByteCounts = 325,
};

tl::unexpected<std::string> bad(std::string_view reason) { return tl::unexpected<std::string>(std::string(reason)); }

class Directory {
 public:
  explicit Directory(std::string_view bytes) : bytes_(bytes), little_(bytes[0] == 'I') {}

  bool find() {
    if (bytes_.size() < 8) return false;
    const std::size_t at = u32(4);
    if (at < 8 || at > bytes_.size() || bytes_.size() - at < 2) return false;
    entries_ = at + 2;
    count_ = u16(at);
    return (bytes_.size() - entries_) / 12 >= count_;
  }

  /// The values of a tag of type SHORT or LONG; empty where it is absent; nothing where its values lie outside of the file.
  [[nodiscard]] std::optional<std::vector<std::uint32_t>> values(Tag tag) const {
    std::vector<std::uint32_t> result;
    for (std::size_t entry = entries_; entry < entries_ + std::size_t{12} * count_; entry += 12) {
      if (u16(entry) != tag) continue;
      const std::uint16_t type = u16(entry + 2);
      const std::uint32_t number = u32(entry + 4);
      if (type != 3 && type != 4) return std::nullopt;
      const std::size_t size = type == 3 ? 2 : 4;
      const std::size_t at = number <= 4 / size ? entry + 8 : u32(entry + 8);
      if (at > bytes_.size() || (bytes_.size() - at) / size < number) return std::nullopt;
      for (std::size_t i = 0; i < number; ++i) result.push_back(type == 3 ? u16(at + i * size) : u32(at + i * size));
      break;
    }
    return result;
  }

  [[nodiscard]] std::uint32_t value(Tag tag, std::uint32_t otherwise) const {
    const auto all = values(tag);
    return all && !all->empty() ? all->front() : otherwise;
  }

 private:
  [[nodiscard]] std::uint16_t u16(std::size_t at) const { return little_ ? little16(bytes_, at) : big16(bytes_, at); }
  [[nodiscard]] std::uint32_t u32(std::size_t at) const { return little_ ? little32(bytes_, at) : big32(bytes_, at); }

  std::string_view bytes_;
  bool little_;
  std::size_t entries_ = 0;
  std::size_t count_ = 0;
};

}  // namespace

Decoded<ImageHeader> read_tiff_header(std::string_view bytes) {
  Directory directory(bytes);
  if (!directory.find()) return bad("a TIFF whose directory lies outside of the file: it is cut off or damaged");
  const std::uint32_t width = directory.value(kWidth, 0);
  const std::uint32_t height = directory.value(kHeight, 0);
  constexpr std::uint32_t kLargest = std::numeric_limits<int>::max();
  if (width == 0 || height == 0 || width > kLargest || height > kLargest) {
    return bad(fmt::format("its header claims {} x {} pixels", width, height));
  }
  ImageHeader header;
  header.format = ImageFormat::kTiff;
  header.info = {static_cast<int>(width), static_cast<int>(height),
                 static_cast<int>(directory.value(kBitsPerSample, 1) & 0xFF)};
  return header;
}

Decoded<bool> check_tiff_whole(std::string_view bytes) {
  Directory directory(bytes);
  if (!directory.find()) return bad("the file is cut off");
  auto offsets = directory.values(kStripOffsets);
  auto counts = directory.values(kStripByteCounts);
  const bool tiled = offsets && offsets->empty();
  if (tiled) {
    offsets = directory.values(kTileOffsets);
    counts = directory.values(kTileByteCounts);
  }
  if (!offsets || !counts || offsets->empty() || offsets->size() != counts->size()) {
    return bad("a TIFF without a usable list of its strips: it is cut off or damaged");
  }
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < offsets->size(); ++i) {
    if ((*offsets)[i] > bytes.size() || (*counts)[i] > bytes.size() - (*offsets)[i]) return bad("the file is cut off");
    total += (*counts)[i];
  }
  const std::uint64_t row_bits =
      std::uint64_t{directory.value(kWidth, 0)} * directory.value(kBitsPerSample, 1) * directory.value(kSamplesPerPixel, 1);
  if (directory.value(kCompression, 1) == 1 && total < (row_bits + 7) / 8 * directory.value(kHeight, 0)) {
    return bad("the file is damaged: its strips hold less than the image");
  }
  return true;
}

}  // namespace crosstie::base::detail
