#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using base::ObservationStatus;
using tests::MarkerScene;

MarkerScene scene_of(const char* family, std::size_t index) {
  MarkerScene scene;
  scene.family = *marker_family(family);
  scene.code = scene.family.codes.at(index).code;
  return scene;
}

struct Tally {
  int right = 0;
  int wrong = 0;
  int refused = 0;
};

void count(const base::Image& image, const MarkerScene& scene, int id, Tally& tally) {
  const auto found = detect(image.view(), scene.family);
  ASSERT_TRUE(found);
  bool read = false;
  for (const base::Observation& observation : found->observations) {
    if (observation.status != ObservationStatus::kCoded) continue;
    read = true;
    ++(observation.id == id ? tally.right : tally.wrong);
  }
  if (!read) ++tally.refused;
}

/// Something darker than the ring's ones covers everything beyond a straight line.
void occlude(std::vector<double>& levels, const MarkerScene& scene, double direction_rad, double from_radii, double level) {
  for (int y = 0; y < scene.height_px; ++y) {
    for (int x = 0; x < scene.width_px; ++x) {
      const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
      const double along = e.x() * std::cos(direction_rad) + e.y() * std::sin(direction_rad);
      if (along > from_radii * scene.radius_px) levels[static_cast<std::size_t>(y * scene.width_px + x)] = level;
    }
  }
}

TEST(RingSafety, BlurGivesNoWrongId) {
  Tally tally;
  for (std::size_t i = 0; i < 54; i += 9) {
    for (const double blur_px : {0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0}) {
      MarkerScene scene = scene_of("ring10", i);
      scene.radius_px = 6.0;
      scene.blur_px = blur_px;
      scene.roll_rad = 0.2 * static_cast<double>(i);
      count(tests::photograph(scene, {2.0, i}), scene, scene.family.codes[i].id, tally);
    }
  }
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.right, 6 * 4);  // sharp enough up to a quarter of the dot's radius
  EXPECT_GT(tally.refused, 0);    // and the worst are refused
}

TEST(RingSafety, MotionWhileExposedGivesNoWrongId) {
  Tally tally;
  for (std::size_t i = 0; i < 54; i += 9) {
    for (const int way_px : {1, 2, 4, 6, 9, 12}) {
      MarkerScene scene = scene_of("ring10", i);
      scene.radius_px = 8.0;
      scene.samples_per_px = 4;
      scene.roll_rad = 0.4 * static_cast<double>(i);
      const std::vector<double> still = tests::rendered(scene);
      std::vector<double> moved(still.size(), 0.0);  // along x: the roll turns the code against it
      for (int y = 0; y < scene.height_px; ++y) {
        for (int x = 0; x < scene.width_px; ++x) {
          for (int k = 0; k < way_px; ++k) {
            const int from = std::clamp(x - k + way_px / 2, 0, scene.width_px - 1);
            moved[static_cast<std::size_t>(y * scene.width_px + x)] +=
                still[static_cast<std::size_t>(y * scene.width_px + from)] / way_px;
          }
        }
      }
      count(tests::photograph(moved, scene.width_px, scene.height_px, {2.0, i}), scene, scene.family.codes[i].id, tally);
    }
  }
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.right, 6 * 3);  // up to half of the dot's radius
  EXPECT_GT(tally.refused, 0);    // and the worst are refused
}

TEST(RingSafety, SmallMarkersAreReadOrRefused) {
  Tally tally;
  for (std::size_t i = 0; i < 54; i += 6) {
    for (const double radius_px : {1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0}) {
      MarkerScene scene = scene_of("ring10", i);
      scene.radius_px = radius_px;
      scene.width_px = scene.height_px = 48;
      scene.centre_px = {23.3 + 0.01 * static_cast<double>(i), 23.8};
      scene.roll_rad = 0.3 * static_cast<double>(i);
      count(tests::photograph(scene, {2.0, i}), scene, scene.family.codes[i].id, tally);
    }
  }
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.right, 2 * 9);  // those whose segments are wide enough
}

TEST(RingSafety, OcclusionOfTheRingGivesNoWrongIdButForHiddenOnes) {
  // Where a dark thing hides whole segments, a ring can turn into another code (the families' distance is 2): the network
  // rejects it. A bright thing shows in the quiet zone, and then nothing may be misread.
  Tally tally;
  for (std::size_t i = 0; i < 516; i += 23) {
    MarkerScene scene = scene_of("aicon14", i);
    std::vector<double> levels = tests::rendered(scene);
    occlude(levels, scene, 0.41 * static_cast<double>(i), 1.6, scene.bright_level);
    count(tests::photograph(levels, scene.width_px, scene.height_px, {2.0, i}), scene, scene.family.codes[i].id, tally);
  }
  EXPECT_EQ(tally.wrong, 0);
}

/// A plate lies over a part of the marker, straight-edged, of any tone: brighter or darker than the ground, or the very same.
Tally behind_plates(const char* family, const std::vector<double>& plate_levels, int count_of_markers) {
  Tally tally;
  for (int i = 0; i < count_of_markers; ++i) {
    const auto index = static_cast<std::size_t>(i);
    MarkerScene scene = scene_of(family, 0);
    scene.code = scene.family.codes[(37 * index) % scene.family.codes.size()].code;
    const int id = scene.family.codes[(37 * index) % scene.family.codes.size()].id;
    scene.roll_rad = 0.37 * i;
    scene.samples_per_px = 4;
    std::vector<double> levels = tests::rendered(scene);
    const double from_radii = 1.2 + (scene.family.ring_outer - 1.2) * (i % 11) / 10.0;
    occlude(levels, scene, 0.61 * i, from_radii, plate_levels[index % plate_levels.size()]);
    count(tests::photograph(levels, scene.width_px, scene.height_px, {2.0, index}), scene, id, tally);
  }
  return tally;
}

TEST(RingSafety, PlatesOverARingWithABorderGiveNoWrongId) {
  const Tally tally = behind_plates("ring10", {8.0, 20.0, 33.0, 45.0, 80.0, 120.0}, 250);
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GT(tally.right, 20);  // those of which the plate hides border and quiet zone only
}

/// Without a border, only what is brighter than dirt is told from the ground. A plate as dark as the ground that ends between
/// two segments looks like zeros: 2 to 3 in 100 are read as another code, and the network has to find out.
TEST(RingSafety, PlatesOverARingWithoutABorderGiveFewWrongIds) {
  for (const char* family : {"aicon12", "aicon14", "agisoft12", "agisoft14"}) {
    const Tally bright = behind_plates(family, {70.0, 80.0, 120.0}, 100);
    EXPECT_EQ(bright.wrong, 0) << family;
    EXPECT_GT(bright.right, 8) << family;  // the quiet zone alone is hidden
    const Tally alike = behind_plates(family, {8.0, 20.0, 33.0, 45.0}, 100);
    EXPECT_LE(alike.wrong, 4) << family;
    EXPECT_GT(alike.right, 20) << family;
  }
}

TEST(RingSafety, GlareGivesNoWrongId) {
  Tally tally;
  for (std::size_t i = 0; i < 54; i += 3) {
    MarkerScene scene = scene_of("ring10", i);
    std::vector<double> levels = tests::rendered(scene);
    const Eigen::Vector2d at =
        scene.centre_px + 18.0 * Eigen::Vector2d(std::cos(static_cast<double>(i)), std::sin(static_cast<double>(i)));
    for (int y = 0; y < scene.height_px; ++y) {
      for (int x = 0; x < scene.width_px; ++x) {
        const double d2 = (Eigen::Vector2d(x, y) - at).squaredNorm();
        levels[static_cast<std::size_t>(y * scene.width_px + x)] += 300.0 * std::exp(-0.5 * d2 / (9.0 * 9.0));
      }
    }
    count(tests::photograph(levels, scene.width_px, scene.height_px, {2.0, i}), scene, scene.family.codes[i].id, tally);
  }
  EXPECT_EQ(tally.wrong, 0);
}

TEST(RingSafety, ShadowAcrossTheRingIsReadThrough) {
  Tally tally;
  for (std::size_t i = 0; i < 20; ++i) {
    MarkerScene scene = scene_of("aicon14", 7 * i);
    scene.dark_level = 4.0;
    std::vector<double> levels = tests::rendered(scene);
    for (int y = 0; y < scene.height_px; ++y) {
      for (int x = 0; x < scene.width_px; ++x) {
        const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
        const double along = e.x() * std::cos(static_cast<double>(i)) + e.y() * std::sin(static_cast<double>(i));
        const double light = 0.35 + 0.65 / (1.0 + std::exp((along - 11.0) / 1.5));
        levels[static_cast<std::size_t>(y * scene.width_px + x)] *= light;
      }
    }
    count(tests::photograph(levels, scene.width_px, scene.height_px, {1.0, i}), scene, scene.family.codes[7 * i].id, tally);
  }
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.right, 18);
}

TEST(RingSafety, MarkersCutByTheBorderAreNotRead) {
  for (const double distance_px : {2.0, 5.0, 9.0, 14.0, 19.0}) {
    MarkerScene scene = scene_of("aicon14", 300);
    scene.centre_px = {distance_px, 47.0};
    const auto found = detect(tests::photograph(scene, {1.0, 1}).view(), scene.family);
    ASSERT_TRUE(found);
    for (const base::Observation& observation : found->observations) {
      EXPECT_NE(observation.status, ObservationStatus::kCoded) << distance_px;
    }
  }
}

/// A mirrored ring10 is a valid code of another id (design): it is read as what it shows.
TEST(RingSafety, MirroredRingsReadAsTheirMirrorImage) {
  for (std::size_t i = 0; i < 54; i += 5) {
    MarkerScene scene = scene_of("ring10", i);
    scene.mirrored = true;
    std::uint64_t mirrored = 0;
    for (int bit = 0; bit < 10; ++bit) mirrored |= ((scene.code >> bit) & 1U) << (9 - bit);
    const std::optional<int> expected = scene.family.id_of_ring(mirrored);
    ASSERT_TRUE(expected);
    const auto found = detect(tests::photograph(scene, {1.0, i}).view(), scene.family);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->observations.size(), 1U);
    EXPECT_EQ(found->observations[0].id, *expected);
  }
}

TEST(RingSafety, NoiseAndTextureHoldNoMarkers) {
  base::Image image(400, 300, 8);
  std::uint64_t state = 88172645463325252ULL;
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 400; ++x) {
      state ^= state << 13;
      state ^= state >> 7;
      state ^= state << 17;
      image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(100 + (state >> 40) % 60 + 30 * ((x / 7 + y / 5) % 2));
    }
  }
  for (const char* family : {"ring10", "aicon14"}) {
    const auto found = detect(image.view(), *marker_family(family));
    ASSERT_TRUE(found);
    for (const base::Observation& observation : found->observations) EXPECT_NE(observation.status, ObservationStatus::kCoded);
  }
}

}  // namespace
}  // namespace crosstie::markers
