#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

// Rendered markers of every family inside of the readable domain, and just below it, from seeds. The number for each family is
// kMarkers, or what CROSSTIE_RECALL_MARKERS says (./run recall sets 1000); CROSSTIE_RECALL_TALK lists those not read.

namespace crosstie::markers {
namespace {

using base::ObservationStatus;
using tests::MarkerScene;

constexpr int kMarkers = 40;
constexpr double kReadablePx = 2.5;      // width of the narrowest segment from which on a ring is read
constexpr double kReadableCellPx = 3.0;  // the same of a tag's cell
constexpr double kSmallestDotPx = 4.0;   // radius across the direction of the tilt

int markers_per_family() {
  const char* wanted = std::getenv("CROSSTIE_RECALL_MARKERS");
  return wanted == nullptr ? kMarkers : std::max(1, std::atoi(wanted));
}

struct Draw {
  MarkerScene scene;
  int id = 0;
  double narrowest_px = 0.0;
  double noise = 0.0;
  std::uint64_t seed = 0;
};

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(engine_); }
  double logarithmic(double from, double to) { return std::exp(uniform(std::log(from), std::log(to))); }

 private:
  std::mt19937_64 engine_;
};

/// Width of the narrowest segment (of a tag: cell, across its longer sides) in px as the domain is defined, for a dot of radius
/// (a cell of side) 1 px in the scene's tilt.
double narrowest_of_unit(const MarkerScene& scene) {
  const MarkerFamily& family = scene.family;
  const double shortened = std::cos(scene.tilt_rad);
  if (!family.tag) {
    return shortened * std::min(std::numbers::pi * (family.ring_inner + family.ring_outer) / family.bits,
                                family.ring_outer - family.ring_inner);
  }
  // Images of the unit vectors: turned by the roll against the tilt axis, then shortened across it.
  const double c = std::cos(scene.roll_rad);
  const double s = std::sin(scene.roll_rad);
  return shortened / std::max(std::hypot(c, s * shortened), std::hypot(s, c * shortened));
}

double readable_px(const MarkerFamily& family) { return family.tag ? kReadableCellPx : kReadablePx; }

/// Half the width of the scene's square that holds the marker at any rotation, for a dot of radius (a cell of side) 1 px.
double reach_of_unit(const MarkerFamily& family) {
  return family.tag ? 0.5 * std::numbers::sqrt2 * (family.tag->total_cells + 2) : family.border_outer;
}

/// A photograph of one marker whose narrowest segment is `from_px` to `to_px` wide. Dots begin at kSmallestDotPx: families with
/// few wide segments are read down to there only.
Draw draw(const MarkerFamily& family, double from_px, double to_px, std::uint64_t seed) {
  Random random(seed * 7919 + 17);
  Draw result;
  MarkerScene& scene = result.scene;
  scene.family = family;
  const auto index = static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(family.codes.size()) - 1e-6));
  scene.code = family.codes[index].code;
  result.id = family.codes[index].id;
  scene.samples_per_px = 4;
  const double narrowest_px = random.logarithmic(from_px, to_px);
  scene.tilt_rad = std::acos(random.uniform(std::cos(70.0 * std::numbers::pi / 180.0), 1.0));
  scene.tilt_axis_rad = random.uniform(0.0, std::numbers::pi);
  scene.roll_rad = random.uniform(0.0, 2.0 * std::numbers::pi);
  scene.radius_px = narrowest_px / narrowest_of_unit(scene);
  if (!family.tag && from_px >= kReadablePx) scene.radius_px = std::max(scene.radius_px, kSmallestDotPx);
  result.narrowest_px = scene.radius_px * narrowest_of_unit(scene);
  scene.blur_px = random.uniform(0.4, std::min(0.33 * narrowest_px, 2.5));
  const double reach_px = reach_of_unit(family) * scene.radius_px + 4.0;
  scene.width_px = scene.height_px = static_cast<int>(std::ceil(2.0 * reach_px)) + 4;
  scene.centre_px = Eigen::Vector2d::Constant(0.5 * scene.width_px - 0.5) +
                    Eigen::Vector2d(random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5));
  scene.dark_on_bright = random.uniform(0.0, 1.0) < 0.5;
  const double contrast = random.logarithmic(40.0, 195.0);
  scene.dark_level = random.uniform(5.0, 205.0 - contrast);
  scene.bright_level = scene.dark_level + contrast;
  result.noise = contrast * random.logarithmic(0.005, 0.04);
  // Up to a fifth more or less light at the border of the marker; what is bright stays below saturation.
  const double slope = random.uniform(0.0, 0.2) / (reach_of_unit(family) * scene.radius_px);
  const double direction = random.uniform(0.0, 2.0 * std::numbers::pi);
  scene.light_slope = slope * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  result.seed = seed;
  return result;
}

struct Tally {
  int right = 0;
  int wrong = 0;
  int all = 0;
  int right_below = 0;  ///< of those whose narrowest segment is 3 % below the limit or more: sizes are measured that well
};

Tally tally(const MarkerFamily& family, double from_px, double to_px, std::uint64_t first_seed) {
  Tally result;
  const bool talk = std::getenv("CROSSTIE_RECALL_TALK") != nullptr;
  for (int i = 0; i < markers_per_family(); ++i) {
    const Draw d = draw(family, from_px, to_px, first_seed + static_cast<std::uint64_t>(i));
    const auto found = detect(tests::photograph(d.scene, {d.noise, d.seed}).view(), family);
    if (!found) {
      ADD_FAILURE() << found.error().message;
      continue;
    }
    ++result.all;
    int right = 0;
    for (const base::Observation& o : found->observations) {
      if (o.status != ObservationStatus::kCoded) continue;
      if (o.id == d.id && (o.centre_px - d.scene.centre_px).norm() < 0.5) {
        ++right;
      } else {
        ++result.wrong;
        ADD_FAILURE() << family.name << " seed " << d.seed << ": read " << o.id << " instead of " << d.id;
      }
    }
    result.right += right == 1 ? 1 : 0;
    if (right > 0 && d.narrowest_px < 0.97 * readable_px(family)) ++result.right_below;
    if (talk && right != 1) {
      std::printf("%s seed %d r %.2f b %.2f tilt %.0f blur %.2f noise %.1f levels %.0f %.0f dark %d:", family.name.c_str(),
                  static_cast<int>(d.seed), d.scene.radius_px, d.scene.radius_px * std::cos(d.scene.tilt_rad),
                  d.scene.tilt_rad * 57.3, d.scene.blur_px, d.noise, d.scene.dark_level, d.scene.bright_level,
                  static_cast<int>(d.scene.dark_on_bright));
      for (const base::Observation& o : found->observations) {
        std::printf(" [%s %d of %d, b %.2f, margin %.2f]", std::string(base::status_name(o.status)).c_str(), o.id, d.id,
                    o.semi_minor_px, o.margin);
      }
      std::printf("\n");
    }
  }
  return result;
}

class Recall : public testing::TestWithParam<std::string> {};

TEST_P(Recall, EveryMarkerInsideOfTheReadableDomainIsReadAndNoneIsMisread) {
  const MarkerFamily family = *marker_family(GetParam());
  const Tally inside = tally(family, 1.01 * readable_px(family), 14.0, 1000);
  EXPECT_EQ(inside.wrong, 0);
  EXPECT_GE(inside.right, 0.995 * inside.all) << inside.right << " of " << inside.all;
  RecordProperty("read", inside.right);
  std::printf("%s: %d of %d read, %d wrong\n", family.name.c_str(), inside.right, inside.all, inside.wrong);
}

TEST_P(Recall, BelowTheReadableDomainMarkersAreRefusedNotMisread) {
  const MarkerFamily family = *marker_family(GetParam());
  const Tally below = tally(family, 0.8 * readable_px(family), readable_px(family), 5000);
  EXPECT_EQ(below.wrong, 0);
  EXPECT_EQ(below.right_below, 0);
}

/// Dots up to 150 px in radius: at this size everything is many pixels wide, and nothing may depend on a window.
TEST(LargeMarkers, AreReadAsWell) {
  for (const char* name : {"ring10", "aicon14", "agisoft16"}) {
    for (const double radius_px : {40.0, 80.0, 150.0}) {
      for (const bool dark : {false, true}) {
        MarkerScene scene;
        scene.family = *marker_family(name);
        scene.code = scene.family.codes[23].code;
        scene.samples_per_px = 2;
        scene.radius_px = radius_px;
        scene.dark_on_bright = dark;
        scene.blur_px = 1.2;
        scene.width_px = scene.height_px = static_cast<int>(2.0 * scene.family.border_outer * radius_px) + 12;
        scene.centre_px = Eigen::Vector2d::Constant(0.5 * scene.width_px - 0.3);
        const auto found = detect(tests::photograph(scene, {2.0, 7}).view(), scene.family);
        ASSERT_TRUE(found);
        int coded = 0;
        for (const base::Observation& o : found->observations) {
          if (o.status != ObservationStatus::kCoded) continue;
          ++coded;
          EXPECT_EQ(o.id, scene.family.codes[23].id) << name << ' ' << radius_px;
        }
        EXPECT_EQ(coded, 1) << name << ' ' << radius_px << ' ' << dark;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Families, Recall, testing::ValuesIn(marker_family_names()), [](const auto& family) {
  std::string name = family.param;
  std::replace(name.begin(), name.end(), ':', '_');
  return name;
});

}  // namespace
}  // namespace crosstie::markers
