// What moves or changes during a capture, against how far it was moved.
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scan/decode.h"
#include "tests/scan/synthetic_scan.h"

namespace crosstie::scan {
namespace {

using base::Pattern;
using base::PatternKind;
using base::PatternSequence;
using tests::SyntheticScan;

/// White and black, the code and fringes, and at the end the first fringes, white and black once more.
PatternSequence with_references(bool repeat) {
  PatternSequence sequence = tests::gray_and_fringes(24.0, 6, false, false);
  if (!repeat) return sequence;
  Pattern white;
  Pattern black;
  black.kind = PatternKind::kBlack;
  sequence.patterns.insert(sequence.patterns.begin(), {white, black});
  Pattern fringes = sequence.patterns[static_cast<std::size_t>(sequence.fringe_images(base::ProjectorAxis::kX, 0).front())];
  fringes.repeat = true;
  sequence.patterns.insert(sequence.patterns.end(), {fringes, white, black});
  return sequence;
}

/// The images before `change` are of the one scene, the others of the other.
base::Result<base::PhaseMap> decoded(const SyntheticScan& before, const SyntheticScan& after, std::size_t change,
                                     const PatternSequence& sequence, std::uint64_t seed, const DecodeOptions& options = {}) {
  std::mt19937_64 random(seed);
  auto decoder = Decoder::make(sequence, before.width, before.height, options);
  if (!decoder) return tl::unexpected(decoder.error());
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    const SyntheticScan& scene = i < change ? before : after;
    auto added = decoder->add(static_cast<int>(i), scene.image(0, sequence, sequence.patterns[i], random));
    if (!added) return tl::unexpected(added.error());
  }
  return decoder->finish();
}

SyntheticScan at_depth(double z_mm) {
  SyntheticScan scene;
  scene.surface = tests::tilted_plane(z_mm, 0.1);
  return scene;
}

/// How far the fringes move in the left image from one scene to the other: root mean square over its pixels.
double fringe_shift_px(const SyntheticScan& before, const SyntheticScan& after) {
  double squares = 0.0, count = 0.0;
  for (int y = 5; y < before.height; y += 10) {
    for (int x = 5; x + 1 < before.width; x += 10) {
      const auto& here = before.seen(0, x, y);
      const auto& next = before.seen(0, x + 1, y);
      const auto& there = after.seen(0, x, y);
      if (!here || !next || !there) continue;
      squares += std::pow((there->u - here->u) / (next->u - here->u), 2);
      count += 1.0;
    }
  }
  return std::sqrt(squares / count);
}

TEST(Stillness, NothingIsSaidOfAStillScene) {
  const SyntheticScan scene;
  const PatternSequence sequence = with_references(true);
  double normalised = 0.0;
  constexpr int kSeeds = 8;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const auto map = decoded(scene, scene, 0, sequence, 200 + seed);
    ASSERT_TRUE(map) << map.error().message;
    const base::Stillness& still = map->stillness;
    EXPECT_TRUE(still.compared && still.shift_told && still.drift_told);
    EXPECT_LT(still.shift_px, 0.01);
    normalised += std::pow(still.shift_px / still.shift_sigma_px, 2) / kSeeds;
    EXPECT_EQ(still.moved_share, 0.0);
    EXPECT_EQ(still.changed_share, 0.0);
    EXPECT_EQ(still.drift_px, 0.0);
    EXPECT_NEAR(*still.light_change, 0.0, 0.001);
    EXPECT_NEAR(*still.ambient_change, 0.0, 0.001);
  }
  // chi-square of 2 directions, 8 times: mean 2, 3 sigmas are 3 sqrt(4 / 8).
  EXPECT_NEAR(normalised, 2.0, 2.1);
  EXPECT_GT(normalised, 0.3);
}

TEST(Stillness, MovementIsMeasuredAndRefused) {
  const SyntheticScan before = at_depth(1200.0);
  const PatternSequence sequence = with_references(true);
  DecodeOptions never;
  never.max_movement_px = 0.0;
  for (const double depth : {1201.0, 1204.0, 1208.0}) {
    const SyntheticScan after = at_depth(depth);
    const double truth_px = fringe_shift_px(before, after);
    const auto map = decoded(before, after, 9, sequence, 220, never);
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_NEAR(map->stillness.shift_px / truth_px, 1.0, 0.15) << depth;
    EXPECT_GT(map->stillness.shift_px, 5.0 * map->stillness.shift_sigma_px);
    const auto judged = decoded(before, after, 9, sequence, 220);
    ASSERT_EQ(judged.has_value(), truth_px < 0.1) << truth_px;
    if (!judged) {
      EXPECT_THAT(judged.error().message, testing::HasSubstr("moved during the scan"));
    }
  }
}

TEST(Stillness, PartThatMovedIsFound) {
  const SyntheticScan before = at_depth(1200.0);
  SyntheticScan after = before;
  // A quarter of the wall comes nearer.
  const auto wall = before.surface;
  const auto nearer = tests::tilted_plane(1190.0, 0.1);
  after.surface = [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const auto distance = wall(origin, direction);
    const Eigen::Vector3d point = origin + *distance * direction;
    return point.x() > 100.0 && point.y() > 0.0 ? nearer(origin, direction) : distance;
  };
  after = [&] {
    SyntheticScan fresh;
    fresh.surface = after.surface;
    return fresh;
  }();
  const auto judged = decoded(before, after, 9, with_references(true), 230);
  ASSERT_FALSE(judged);
  EXPECT_THAT(judged.error().message, testing::HasSubstr("moved during the scan"));
}

TEST(Stillness, ChangedLightIsNamedInPerCent) {
  const SyntheticScan before;
  const PatternSequence sequence = with_references(true);
  for (const double change : {-0.3, 0.04}) {
    SyntheticScan after = before;
    after.amplitude *= 1.0 + change;
    DecodeOptions never;
    never.max_light_change = 0.0;
    never.max_movement_px = 0.0;
    const auto map = decoded(before, after, 9, sequence, 240, never);
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_NEAR(*map->stillness.light_change, change, 0.003);
    EXPECT_LT(map->stillness.shift_px, 0.02) << "light is no movement";
    const auto judged = decoded(before, after, 9, sequence, 240);
    EXPECT_EQ(judged.has_value(), std::abs(change) < 0.1);
    if (!judged) {
      EXPECT_THAT(judged.error().message, testing::HasSubstr("the projector's light changed by"));
    }
  }
  SyntheticScan lamp = before;
  lamp.ambient += 0.2 * 2.0 * before.amplitude;
  const auto judged = decoded(before, lamp, 9, sequence, 241);
  ASSERT_FALSE(judged);
  EXPECT_THAT(judged.error().message, testing::HasSubstr("other light changed by +20"));
}

TEST(Stillness, ResidualsTellMovementWithoutRepeats) {
  const SyntheticScan before = at_depth(1200.0);
  const PatternSequence sequence = with_references(false);
  DecodeOptions never;
  never.max_movement_px = 0.0;
  const std::size_t fringes = static_cast<std::size_t>(sequence.fringe_images(base::ProjectorAxis::kX, 0).front());
  for (const double depth : {1202.0, 1215.0}) {
    const SyntheticScan after = at_depth(depth);
    const double truth_px = fringe_shift_px(before, after);
    const auto map = decoded(before, after, fringes + 3, sequence, 250, never);
    ASSERT_TRUE(map) << map.error().message;
    // Half of the images lie to one side of the mean, half to the other.
    EXPECT_FALSE(map->stillness.compared);
    EXPECT_NEAR(map->stillness.drift_px / (0.5 * truth_px), 1.0, 0.5) << depth;
    const auto judged = decoded(before, after, fringes + 3, sequence, 250);
    EXPECT_EQ(judged.has_value(), map->stillness.drift_px < 0.1);
    if (!judged) {
      EXPECT_THAT(judged.error().message, testing::HasSubstr("fringes moved during the scan"));
    }
  }
}

}  // namespace
}  // namespace crosstie::scan
