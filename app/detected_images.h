#pragma once

#include <filesystem>
#include <vector>

#include "base/observation.h"
#include "base/result.h"

namespace crosstie::app {

/// The images of a result of `detect`, those without observations too, in its order; names and sizes, but neither camera nor family,
/// which only the job knows for certain.
base::Result<std::vector<base::ImageObservations>> detected_images(const std::filesystem::path& folder);

}  // namespace crosstie::app
