// Depths and their sigmas against the surface of a synthetic scan.
#include "scan/match.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scan/decode.h"
#include "tests/scan/synthetic_scan.h"

namespace crosstie::scan {
namespace {

using tests::SyntheticScan;

std::array<base::PhaseMap, 2> phases(const SyntheticScan& scene, const base::PatternSequence& sequence, std::uint64_t seed) {
  std::array<base::PhaseMap, 2> maps;
  for (int camera = 0; camera < 2; ++camera) {
    std::mt19937_64 random(2 * seed + static_cast<std::uint64_t>(camera));
    auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
      EXPECT_TRUE(decoder->add(static_cast<int>(i), scene.image(camera, sequence, sequence.patterns[i], random)));
    }
    auto map = decoder->finish();
    EXPECT_TRUE(map) << map.error().message;
    maps[static_cast<std::size_t>(camera)] = *std::move(map);
  }
  return maps;
}

using Errors = tests::NormalisedErrors;

/// Along the viewing ray.
Errors errors_of(const SyntheticScan& scene, const DepthMap& map) {
  Errors errors;
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const auto at = static_cast<std::size_t>(y * scene.width + x);
      if (std::isnan(map.depth_mm[at])) continue;
      const auto& seen = scene.seen(0, x, y);
      if (!seen) {
        errors.add_far();
        continue;
      }
      const double along_ray = seen->point_mm.norm() / seen->point_mm.z();
      errors.add((static_cast<double>(map.depth_mm[at]) - seen->point_mm.z()) * along_ray /
                 static_cast<double>(map.sigma_mm[at]));
    }
  }
  return errors;
}

TEST(Match, SigmasAlongTheRayAreTrue) {
  for (const double tilt : {0.1, 0.6, -0.5}) {
    for (const bool both : {false, true}) {
      SyntheticScan scene;
      scene.surface = tests::tilted_plane(1200.0, tilt);
      const auto sequence = tests::gray_and_fringes(24.0, 6, false, both);
      const auto maps = phases(scene, sequence, 21);
      const auto map = match(maps[0], maps[1], scene.head, {});
      ASSERT_TRUE(map) << map.error().message;
      const Errors errors = errors_of(scene, *map);
      SCOPED_TRACE(testing::Message() << "tilt " << tilt << ", both directions " << both);
      EXPECT_GT(errors.count, 20000);
      EXPECT_EQ(errors.far, 0);
      EXPECT_NEAR(errors.rms(), 1.0, 0.05);
      EXPECT_NEAR(errors.mean(), 0.0, 0.05);
      if (both) {
        EXPECT_NEAR(map->epipolar_median_px, 0.0, 0.01);
      }
    }
  }
}

TEST(Match, NoisePhasesAreMatchedWithoutBias) {
  SyntheticScan scene;
  scene.amplitude = 12.0;  // phases whose noise is larger than their change from pixel to pixel
  const auto sequence = tests::gray_and_fringes(8.0, 4, false, false);
  const auto maps = phases(scene, sequence, 22);
  const auto map = match(maps[0], maps[1], scene.head, {});
  ASSERT_TRUE(map) << map.error().message;
  const Errors errors = errors_of(scene, *map);
  EXPECT_GT(errors.count, 20000);
  EXPECT_NEAR(errors.rms(), 1.0, 0.05);
  EXPECT_NEAR(errors.mean(), 0.0, 0.05);
}

TEST(Match, NothingStandsBeyondARim) {
  SyntheticScan scene;
  const auto wall = tests::tilted_plane(1200.0, 0.1);
  const auto behind = tests::tilted_plane(1500.0, 0.0);
  scene.surface = [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) -> std::optional<double> {
    const auto distance = wall(origin, direction);
    const Eigen::Vector3d point = origin + *distance * direction;
    if (std::hypot(point.x() - 150.0, point.y()) < 120.0) return behind(origin, direction);
    return distance;
  };
  const auto maps = phases(scene, tests::gray_and_fringes(24.0, 6, false, true), 23);
  const auto map = match(maps[0], maps[1], scene.head, {});
  ASSERT_TRUE(map) << map.error().message;
  const Errors errors = errors_of(scene, *map);
  EXPECT_GT(errors.count, 15000);
  EXPECT_EQ(errors.far, 0);
  EXPECT_GT(map->guarded, 500);
  EXPECT_NEAR(errors.rms(), 1.0, 0.05);
}

TEST(Match, TwoDirectionsShowAWrongHead) {
  const SyntheticScan scene;
  const auto maps = phases(scene, tests::gray_and_fringes(24.0, 6, false, true), 24);
  base::Head pitched = scene.head;
  pitched.right_from_left.rotation = base::rotation_exp({1e-3, 0.0, 0.0}) * pitched.right_from_left.rotation;
  const auto map = match(maps[0], maps[1], pitched, {});
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_NEAR(std::abs(map->epipolar_median_px), 0.5, 0.1);  // a milliradian of 500 px
}

TEST(Match, WhatCannotBeMatchedIsRefused) {
  const SyntheticScan scene;
  const auto maps = phases(scene, tests::gray_and_fringes(24.0, 6, false, false), 25);
  base::Head same_place = scene.head;
  same_place.right_from_left.translation_mm.setZero();
  EXPECT_THAT(match(maps[0], maps[1], same_place, {}).error().message, testing::HasSubstr("side by side"));
  base::PhaseMap turned = maps[1];
  turned.y = std::move(turned.x);
  turned.x.reset();
  EXPECT_THAT(match(maps[0], turned, scene.head, {}).error().message, testing::HasSubstr("different directions"));
  base::PhaseMap small = maps[1];
  small.width = 100;
  EXPECT_THAT(match(maps[0], small, scene.head, {}).error().message, testing::HasSubstr("100 x 240"));

  base::PatternSequence along = tests::gray_and_fringes(24.0, 6, false, true);
  std::erase_if(along.patterns, [](const base::Pattern& pattern) { return pattern.axis == base::ProjectorAxis::kX; });
  along.x = {};
  const auto lying = phases(scene, along, 26);
  const auto none = match(lying[0], lying[1], scene.head, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, base::ErrorCode::kNoUniqueSolution);
}

}  // namespace
}  // namespace crosstie::scan
