// Markers in the images of a scan.

#include "app/scan_markers.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "base/parallel.h"

namespace crosstie::app {
namespace {

constexpr double kMost16 = 65535.0;

}  // namespace

base::Image marker_image(const std::optional<base::Image>& white, const base::PhaseMap& map, double white_level) {
  if (white) return *white;
  const double scale = std::floor(kMost16 / white_level);
  base::Image image(map.width, map.height, 16);
  image.set_white_level(scale * white_level);
  for (int y = 0; y < map.height; ++y) {
    auto* row = image.row<std::uint16_t>(y);
    for (int x = 0; x < map.width; ++x) {
      const double level = scale * static_cast<double>(map.light[map.at(x, y)]);
      row[x] = static_cast<std::uint16_t>(std::clamp(std::isfinite(level) ? std::round(level) : 0.0, 0.0, kMost16));
    }
  }
  return image;
}

std::array<base::ImageObservations, 2> no_markers(const ScanTask& task) {
  std::array<base::ImageObservations, 2> found;
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const char* name = camera == 0 ? "left" : "right";
    found[camera].camera = name;
    found[camera].image = task.station.empty() ? name : station_image(task.station, name);
    if (task.markers) found[camera].family = task.markers->family.name;
  }
  return found;
}

base::Result<std::array<base::ImageObservations, 2>> scan_markers(const ScanTask& task,
                                                                  const std::array<base::Image, 2>& images, Session& session) {
  std::array<base::ImageObservations, 2> found = no_markers(task);
  auto done =
      base::parallel_for(2, session.threads(), "markers", session.progress(), [&](std::size_t camera) -> base::Result<> {
        auto seen = markers::detect(images[camera].view(), task.markers->family, task.markers->options);
        if (!seen) return base::fail(seen.error().code, fmt::format("{}: {}", found[camera].image, seen.error().message));
        seen->image = found[camera].image;
        seen->camera = found[camera].camera;
        seen->family = found[camera].family;
        found[camera] = *std::move(seen);
        return {};
      });
  if (!done) return base::fail(std::move(done));
  return found;
}

}  // namespace crosstie::app
