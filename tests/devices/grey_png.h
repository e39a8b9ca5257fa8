#pragma once

#include <cstdint>
#include <string>

#include "base/file.h"
#include "base/image.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// The bytes of a small PNG of one grey level.
inline std::string grey_png(int level) {
  base::Image image(32, 24, 8);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(level);
  }
  const TemporaryFolder folder;
  if (!base::write_image(folder / "grey.png", image.view())) return {};
  return read_all(folder / "grey.png");
}

}  // namespace crosstie::tests
