// exif_focal_px() of base/image.h.
#include <cmath>

#include <exiv2/exiv2.hpp>

#include "base/file.h"
#include "base/image.h"

namespace crosstie::base {
namespace {

constexpr double kFullFrameWidthMm = 36.0;
constexpr std::size_t kMaxExifFileBytes = std::size_t{2} << 30;

std::optional<double> positive_number(const Exiv2::ExifData& exif, const char* key) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  if (found == exif.end() || found->count() == 0) return std::nullopt;
  const Exiv2::Rational value = found->toRational();
  if (value.first <= 0 || value.second <= 0) return std::nullopt;
  return static_cast<double>(value.first) / static_cast<double>(value.second);
}

/// Millimetres of the unit in which the focal plane's resolution is given (EXIF 2.32, tag 0xA210); inch where it is not said.
std::optional<double> resolution_unit_mm(const Exiv2::ExifData& exif) {
  const auto unit = positive_number(exif, "Exif.Photo.FocalPlaneResolutionUnit").value_or(2.0);
  if (unit == 2.0) return 25.4;
  if (unit == 3.0) return 10.0;
  if (unit == 4.0) return 1.0;
  return std::nullopt;
}

std::optional<double> focal_px(const Exiv2::ExifData& exif, int width_px, int height_px) {
  const auto focal_mm = positive_number(exif, "Exif.Photo.FocalLength");
  const auto resolution = positive_number(exif, "Exif.Photo.FocalPlaneXResolution");
  const auto unit_mm = resolution_unit_mm(exif);
  if (focal_mm && resolution && unit_mm) {
    // The resolution counts the pixels of the picture as taken; a picture that was scaled later has fewer.
    const double taken_px = positive_number(exif, "Exif.Photo.PixelXDimension").value_or(width_px);
    return *focal_mm * *resolution / *unit_mm * (width_px / taken_px);
  }
  if (const auto equivalent_mm = positive_number(exif, "Exif.Photo.FocalLengthIn35mmFilm")) {
    return *equivalent_mm / kFullFrameWidthMm * std::max(width_px, height_px);
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> exif_focal_px(const std::filesystem::path& path) {
  const auto info = read_image_info(path);
  if (!info) return std::nullopt;
  const auto bytes = read_file(path, kMaxExifFileBytes);
  if (!bytes) return std::nullopt;
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  try {
    const auto image =
        Exiv2::ImageFactory::open(reinterpret_cast<const Exiv2::byte*>(bytes->data()), static_cast<long>(bytes->size()));
    if (image.get() == nullptr) return std::nullopt;
    image->readMetadata();
    const auto focal = focal_px(image->exifData(), info->width, info->height);
    return focal && std::isfinite(*focal) ? focal : std::nullopt;
  } catch (const std::exception&) {
    return std::nullopt;  // damaged EXIF data says nothing
  }
}

}  // namespace crosstie::base
