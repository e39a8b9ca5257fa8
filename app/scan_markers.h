#pragma once

#include <array>
#include <optional>

#include "app/steps_scan.h"
#include "base/image.h"
#include "base/observation.h"
#include "base/phase_map.h"

namespace crosstie::app {

/// The image in which a camera's markers are looked for: the white one, else the mean of the fringe images, in 16 bits.
[[nodiscard]] base::Image marker_image(const std::optional<base::Image>& white, const base::PhaseMap& map, double white_level);

/// The markers in both cameras' images, called STATION/left and STATION/right.
base::Result<std::array<base::ImageObservations, 2>> scan_markers(const ScanTask& task,
                                                                  const std::array<base::Image, 2>& images, Session& session);

/// The same without a single marker.
std::array<base::ImageObservations, 2> no_markers(const ScanTask& task);

}  // namespace crosstie::app
