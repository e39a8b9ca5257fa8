#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/phase_map.h"
#include "fixtures/fringes.h"
#include "scan/match.h"
#include "scan/patterns.h"

namespace crosstie::tests {

/// A scan of the twin's wall by the scanner under test, and what is true of each pixel of the left image.
struct WallScan {
  std::array<base::PhaseMap, 2> maps;
  scan::DepthMap depths;
};

/// Light on both cameras under each pattern, so that many seeds cost no more rays.
struct WallLight {
  scan::PatternOptions options;
  base::PatternSequence sequence;
  std::array<std::vector<fixtures::Irradiance>, 2> images;
};

/// What is true of a pixel's centre, and how far the nearest end of its surface is.
struct PixelTruth {
  fixtures::WallPart part = fixtures::WallPart::kBackground;
  int area = -1;
  bool lit = false;
  bool common = false;     ///< the other camera sees it, too
  float depth_mm = 0.0F;   ///< z
  float along_ray = 1.0F;  ///< distance over z
  float cosine = 0.0F;     ///< between normal and ray
  float rim_px = 1e9F;     ///< distance from the nearest pixel, within kNearPx, of another part or shadow
  float tone_px = 1e9F;    ///< the same of another area or marker
};
inline constexpr int kNearPx = 6;

WallLight light_on(const fixtures::FringeStation& station, const scan::PatternOptions& options);
WallScan scan_wall(const fixtures::Scene& scene, const fixtures::FringeStation& station, const WallLight& light,
                   std::uint64_t seed);
std::vector<PixelTruth> truth_of(const fixtures::FringeStation& station);

}  // namespace crosstie::tests
