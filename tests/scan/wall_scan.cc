#include "tests/scan/wall_scan.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "scan/decode.h"

namespace crosstie::tests {

using fixtures::FringeStation;

WallLight light_on(const FringeStation& station, const scan::PatternOptions& options) {
  WallLight light{options, *scan::make_patterns(options), {}};
  // What the decoder does not look at need not be rendered.
  std::erase_if(light.sequence.patterns, [](const base::Pattern& pattern) {
    return pattern.kind == base::PatternKind::kWhite || pattern.kind == base::PatternKind::kBlack;
  });
  for (std::size_t camera = 0; camera < 2; ++camera) {
    for (const base::Pattern& pattern : light.sequence.patterns) {
      auto image = station.irradiance(static_cast<int>(camera), scan::render_pattern(options, light.sequence, pattern).view());
      EXPECT_TRUE(image) << image.error().message;
      light.images[camera].push_back(*std::move(image));
    }
  }
  return light;
}

WallScan scan_wall(const fixtures::Scene& scene, const FringeStation& station, const WallLight& light, std::uint64_t seed) {
  WallScan result;
  const base::Head head = station.head();
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const std::string& name = camera == 0 ? head.left_name : head.right_name;
    const auto by = std::find_if(scene.cameras.begin(), scene.cameras.end(), [&](const auto& c) { return c.name == name; });
    const auto& first = light.images[camera].front();
    auto decoder = scan::Decoder::make(light.sequence, first.width, first.height, {});
    for (std::size_t i = 0; i < light.sequence.patterns.size(); ++i) {
      const std::uint64_t stream = (seed * 2 + camera) * 1000 + i;
      auto added = decoder->add(
          static_cast<int>(i),
          fixtures::expose(light.images[camera][i], by->sensor, by->exposure * light.sequence.patterns[i].exposure, stream));
      EXPECT_TRUE(added) << added.error().message;
    }
    auto map = decoder->finish();
    EXPECT_TRUE(map) << map.error().message;
    if (map) result.maps[camera] = *std::move(map);
  }
  auto depths = scan::match(result.maps[0], result.maps[1], head, {.guard_creases = true});
  EXPECT_TRUE(depths) << depths.error().message;
  if (depths) result.depths = *std::move(depths);
  return result;
}

std::vector<PixelTruth> truth_of(const FringeStation& station) {
  const base::Head head = station.head();
  const int width = head.left.width_px();
  const int height = head.left.height_px();
  std::vector<PixelTruth> truth(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto at = [&](int x, int y) -> PixelTruth& {
    return truth[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto seen = station.seen(0, Eigen::Vector2d(x, y));
      if (!seen) continue;
      PixelTruth& pixel = at(x, y);
      pixel.part = seen->part;
      pixel.area = seen->part == fixtures::WallPart::kMarker ? 1'000'000 + seen->id : seen->area;
      pixel.lit = seen->lit && seen->projector_px.has_value();
      pixel.common = seen->other_px.has_value();
      pixel.depth_mm = static_cast<float>(seen->point_mm.z());
      pixel.along_ray = static_cast<float>(seen->point_mm.norm() / seen->point_mm.z());
      pixel.cosine = static_cast<float>(-seen->normal.dot(seen->point_mm.normalized()));
    }
  }
  const auto on_wall = [](const PixelTruth& p) {
    return p.part == fixtures::WallPart::kFace || p.part == fixtures::WallPart::kMarker;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      PixelTruth& pixel = at(x, y);
      const PixelTruth& right = at(std::min(x + 1, width - 1), y);
      const PixelTruth& below = at(x, std::min(y + 1, height - 1));
      for (const PixelTruth* next : {&right, &below}) {
        const bool rim = on_wall(*next) != on_wall(pixel) || next->lit != pixel.lit;
        if (!rim && next->area == pixel.area) continue;
        for (int dy = -kNearPx; dy <= kNearPx; ++dy) {
          for (int dx = -kNearPx; dx <= kNearPx; ++dx) {
            if (x + dx < 0 || y + dy < 0 || x + dx >= width || y + dy >= height) continue;
            // The change lies half-way to the next pixel.
            const double off_x = dx - (next == &right ? 0.5 : 0.0);
            const double off_y = dy - (next == &below ? 0.5 : 0.0);
            const auto distance = static_cast<float>(std::hypot(off_x, off_y));
            PixelTruth& there = at(x + dx, y + dy);
            (rim ? there.rim_px : there.tone_px) = std::min(rim ? there.rim_px : there.tone_px, distance);
          }
        }
      }
    }
  }
  return truth;
}

}  // namespace crosstie::tests
