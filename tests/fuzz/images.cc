// Image files: PNG, TIFF, BMP, PGM and JPEG are told apart by their contents. PNG chunks get their check sums by png_mutator.cc.
#include "base/image.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  const auto path = fuzz::file("image", fuzz::text_of(data, size));
  const auto info = base::read_image_info(path);
  const auto image = base::read_image(path);
  fuzz::sensible(info);
  if (fuzz::sensible(image)) {
    fuzz::expect(info && info->width == image->width() && info->height == image->height(), "header and image agree");
    fuzz::expect(image->bits() == 8 || image->bits() == 16, "samples have 8 or 16 bits");
  }
  if (const auto focal = base::exif_focal_px(path)) fuzz::expect(*focal > 0.0, "a focal length is positive");
  return 0;
}
