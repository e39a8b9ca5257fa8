#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera.h"

namespace crosstie::app {

/// The words that jobs and options have for lens models: "pinhole", "opencv4", ...
[[nodiscard]] const std::vector<std::string>& lens_words();
[[nodiscard]] std::optional<base::LensModel> lens_from_word(std::string_view word);
[[nodiscard]] std::string lens_word(base::LensModel lens);

}  // namespace crosstie::app
