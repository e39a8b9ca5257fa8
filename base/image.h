#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/result.h"

namespace crosstie::base {

/// A grey-level image that somebody else owns: rows of 8- or 16-bit samples. Pixel (0, 0) is the first sample of the first row.
struct ImageView {
  const std::byte* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t row_stride_bytes = 0;
  int bits = 8;              ///< of storage: 8 (uint8_t) or 16 (uint16_t)
  double white_level = 255;  ///< grey level of a saturated pixel (65535 or the sensor's, e.g. 4095, for 16 bits)

  template <typename Sample>
  [[nodiscard]] const Sample* row(int y) const {
    return reinterpret_cast<const Sample*>(data + y * row_stride_bytes);
  }
};

/// A grey-level image that owns its samples, without padding.
class Image {
 public:
  Image() = default;
  /// A black image; bits is 8 or 16.
  Image(int width, int height, int bits);

  [[nodiscard]] ImageView view() const;
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int bits() const { return bits_; }
  [[nodiscard]] bool empty() const { return samples_.empty(); }
  [[nodiscard]] double white_level() const { return white_level_; }
  void set_white_level(double level) { white_level_ = level; }

  template <typename Sample>
  [[nodiscard]] Sample* row(int y) {
    return reinterpret_cast<Sample*>(samples_.data()) + static_cast<std::ptrdiff_t>(y) * width_;
  }

 private:
  int width_ = 0;
  int height_ = 0;
  int bits_ = 8;
  double white_level_ = 255;
  std::vector<std::byte> samples_;
};

/// An 8-bit RGB image, for pictures that people look at.
struct ColourImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;  ///< 3 * width * height, row by row
};

/// What an image file says of itself without its pixels.
struct ImageInfo {
  int width = 0;
  int height = 0;
  int bits = 8;  ///< per sample
};

/// Size of the largest image that is read, in pixels: a header that claims more is refused before anything is allocated.
inline constexpr std::int64_t kMaxImagePixels = 400'000'000;

/// Reads PNG, TIFF, BMP, PGM or JPEG as grey levels (colour is reduced to luminance, EXIF rotation is not applied: a
/// measuring camera's pixels stay where its sensor has them).
///
/// Damaged files are refused, also those that the decoders let pass in silence: the header is checked against the file's size,
/// a JPEG must end with its end-of-image marker and decode without a warning.
Result<Image> read_image(const std::filesystem::path& path);

/// Size and depth from the header alone.
Result<ImageInfo> read_image_info(const std::filesystem::path& path);

/// The focal length in px from the EXIF data: from focal length and focal-plane resolution, or from the 35 mm equivalent (of a
/// 36 mm wide frame). Nothing where the file does not say.
std::optional<double> exif_focal_px(const std::filesystem::path& path);

/// Writes a PNG (the extension decides; only .png) atomically.
Result<> write_image(const std::filesystem::path& path, const ImageView& image);
Result<> write_image(const std::filesystem::path& path, const ColourImage& image);

}  // namespace crosstie::base
