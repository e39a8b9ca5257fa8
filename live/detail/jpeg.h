#pragma once

#include <string>

#include "base/image.h"
#include "base/result.h"

namespace crosstie::live::detail {

/// A baseline JPEG file (JFIF, colours at half the resolution). `quality` is libjpeg's, 1 to 100.
/// Errors: kUsage for an empty picture or a quality out of its domain, kInternal where the encoder fails.
[[nodiscard]] base::Result<std::string> encode_jpeg(const base::ColourImage& picture, int quality);

}  // namespace crosstie::live::detail
