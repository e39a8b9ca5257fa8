#include "base/image.h"

#include <cassert>

#include <fmt/format.h>

#include "base/detail/image_codec.h"
#include "base/file.h"

namespace crosstie::base {
namespace {

/// Larger than any image of kMaxImagePixels that a measuring camera writes.
constexpr std::size_t kMaxImageBytes = std::size_t{2} << 30;
/// Deflate packs at most 1032 bytes into one, and a byte holds at most 8 pixels; the other compressions stay below that. A
/// header that claims more is refused before anything is allocated for it.
constexpr std::int64_t kMaxPixelsPerByte = std::int64_t{1032} * 8;
constexpr std::int64_t kAlwaysAllowedPixels = 1'000'000;

struct LoadedFile {
  std::string bytes;
  detail::ImageHeader header;
};

tl::unexpected<Error> refused(const std::filesystem::path& path, const std::string& reason) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), reason));
}

Result<LoadedFile> load(const std::filesystem::path& path) {
  auto bytes = read_file(path, kMaxImageBytes);
  if (!bytes) return fail(std::move(bytes));
  auto header = detail::read_header(*bytes);
  if (!header) return refused(path, header.error());
  const std::int64_t pixels = std::int64_t{header->info.width} * header->info.height;
  if (pixels > kMaxImagePixels) {
    return refused(path, fmt::format("its header claims {} x {} pixels, more than the {} that are read", header->info.width,
                                     header->info.height, kMaxImagePixels));
  }
  if (pixels > kAlwaysAllowedPixels + kMaxPixelsPerByte * static_cast<std::int64_t>(bytes->size())) {
    return refused(path, fmt::format("its header claims {} x {} pixels, more than its {} bytes can hold", header->info.width,
                                     header->info.height, bytes->size()));
  }
  return LoadedFile{*std::move(bytes), *header};
}

}  // namespace

Image::Image(int width, int height, int bits)
    : width_(width),
      height_(height),
      bits_(bits),
      white_level_(bits == 16 ? 65535.0 : 255.0),
      samples_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(bits / 8)) {
  assert(width > 0 && height > 0 && (bits == 8 || bits == 16));
}

ImageView Image::view() const {
  return {samples_.data(), width_, height_, static_cast<std::ptrdiff_t>(width_) * (bits_ / 8), bits_, white_level_};
}

Result<Image> read_image(const std::filesystem::path& path) {
  auto file = load(path);
  if (!file) return fail(std::move(file));
  auto image = detail::decode(file->bytes, file->header);
  if (!image) return refused(path, image.error());
  return *std::move(image);
}

Result<ImageInfo> read_image_info(const std::filesystem::path& path) {
  auto file = load(path);
  if (!file) return fail(std::move(file));
  return file->header.info;
}

Result<> write_image(const std::filesystem::path& path, const ImageView& image) {
  if (path.extension() != ".png") {
    return fail(ErrorCode::kUsage, fmt::format("{}: images are written as .png only", shown(path)));
  }
  auto bytes = detail::encode_png(image);
  if (!bytes) return fail(ErrorCode::kInternal, fmt::format("{}: {}", shown(path), bytes.error()));
  return write_file_atomically(path, *bytes);
}

Result<> write_image(const std::filesystem::path& path, const ColourImage& image) {
  if (path.extension() != ".png") {
    return fail(ErrorCode::kUsage, fmt::format("{}: images are written as .png only", shown(path)));
  }
  auto bytes = detail::encode_png(image);
  if (!bytes) return fail(ErrorCode::kInternal, fmt::format("{}: {}", shown(path), bytes.error()));
  return write_file_atomically(path, *bytes);
}

}  // namespace crosstie::base
