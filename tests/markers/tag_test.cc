#include "markers/tags.h"

#include <bit>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using base::ObservationStatus;
using tests::MarkerScene;
using tests::photograph;

MarkerScene scene_of(const std::string& family, std::size_t index, double cell_px) {
  MarkerScene scene;
  scene.family = *marker_family(family);
  scene.code = scene.family.codes.at(index).code;
  scene.dark_on_bright = true;
  scene.radius_px = cell_px;
  const double half_px = 0.5 * std::numbers::sqrt2 * (scene.family.tag->total_cells + 2) * cell_px;
  scene.width_px = scene.height_px = static_cast<int>(2.0 * half_px) + 8;
  scene.centre_px = {0.5 * scene.width_px + 0.21, 0.5 * scene.height_px - 0.37};
  scene.samples_per_px = 5;
  return scene;
}

std::vector<std::string> tag_families() {
  std::vector<std::string> names = marker_family_names();
  std::erase_if(names, [](const std::string& name) { return !name.starts_with("apriltag:"); });
  return names;
}

/// e^T Q^-1 e of the centre: below 18.4 with a probability of 99.99 %.
double squared_error_in_sigmas(const TagObservation& tag, const MarkerScene& scene) {
  const Eigen::Vector2d e = tag.centre_px - scene.centre_px;
  return e.dot(tag.cov_px2.inverse() * e);
}

/// The only tag in the photograph.
TagObservation only(const base::Image& image, const MarkerFamily& family, const DetectOptions& options = {}) {
  const auto found = detect_tags(image.view(), family, options);
  EXPECT_TRUE(found);
  EXPECT_EQ(found->size(), 1U) << family.name;
  return found && !found->empty() ? found->front() : TagObservation{};
}

TEST(Tags, EveryFamilyIsReadInBothTonesAndAnyRotation) {
  for (const std::string& name : tag_families()) {
    for (std::size_t i = 0; i < 8; ++i) {
      MarkerScene scene = scene_of(name, 3 * i, 5.0);
      scene.dark_on_bright = i % 2 == 0;
      scene.roll_rad = 0.2 + 0.8 * static_cast<double>(i);
      const TagObservation tag = only(photograph(scene, {1.0, i}), scene.family);
      EXPECT_EQ(tag.status, ObservationStatus::kCoded) << name << ' ' << i;
      EXPECT_EQ(tag.id, static_cast<int>(3 * i)) << name;
      EXPECT_EQ(tag.inverted, !scene.dark_on_bright);
      EXPECT_FALSE(tag.mirrored);
      EXPECT_LT((tag.centre_px - scene.centre_px).norm(), 0.02) << name << ' ' << i;
      EXPECT_NEAR(tag.cell_px, 5.0, 0.03);
      EXPECT_GT(tag.margin, 0.6);
    }
  }
}

/// Upper left corner first, then clockwise, whatever the rotation.
TEST(Tags, CornersAreThoseOfTheTag) {
  for (const double roll_rad : {0.0, 0.9, 2.4, 3.9, 5.5}) {
    MarkerScene scene = scene_of("apriltag:tag36h11", 77, 6.0);
    scene.roll_rad = roll_rad;
    const TagObservation tag = only(photograph(scene, {1.0, 5}), scene.family);
    Eigen::Matrix2d pixel_from_tag;
    pixel_from_tag << std::cos(roll_rad), -std::sin(roll_rad), std::sin(roll_rad), std::cos(roll_rad);
    const std::array<Eigen::Vector2d, 4> cells = {Eigen::Vector2d(-4, -4), Eigen::Vector2d(4, -4), Eigen::Vector2d(4, 4),
                                                  Eigen::Vector2d(-4, 4)};
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d expected = scene.centre_px + 6.0 * pixel_from_tag * cells[k];
      EXPECT_LT((tag.corners_px[k] - expected).norm(), 0.03) << roll_rad << ' ' << k;
    }
  }
}

/// The centre is the image of the tag's centre, not the middle of its image.
TEST(Tags, CentreIsTheImageOfTheCentreInPerspective) {
  for (const char* name : {"apriltag:tag36h11", "apriltag:tagStandard41h12"}) {
    MarkerScene scene = scene_of(name, 11, 7.0);
    scene.tilt_rad = 0.8;
    scene.tilt_axis_rad = 0.4;
    scene.perspective = {0.0021, -0.0013};
    const TagObservation tag = only(photograph(scene, {0.5, 3}), scene.family);
    EXPECT_EQ(tag.status, ObservationStatus::kCoded);
    EXPECT_LT(squared_error_in_sigmas(tag, scene), 18.4) << name;
    EXPECT_LT((tag.centre_px - scene.centre_px).norm(), 0.02) << name;
    const Eigen::Vector2d middle = 0.25 * (tag.corners_px[0] + tag.corners_px[1] + tag.corners_px[2] + tag.corners_px[3]);
    EXPECT_GT((middle - scene.centre_px).norm(), 0.5);
  }
}

struct Case {
  const char* name;
  const char* family;
  double cell_px, tilt_deg, blur_px, noise;
  bool published;
};

/// Mean of e^T Q^-1 e over the seeds and the degrees of freedom: 1 where the covariance is the truth.
TEST(Tags, CovarianceIsTheScatterOverSeeds) {
  for (const Case& c : {Case{"small", "apriltag:tag36h11", 3.2, 0.0, 0.6, 3.0, true},
                        Case{"medium", "apriltag:tag36h11", 6.0, 40.0, 0.8, 2.0, true},
                        Case{"noisy", "apriltag:tag16h5", 8.0, 20.0, 0.7, 8.0, true},
                        Case{"inverted", "apriltag:tag25h9", 7.0, 50.0, 0.7, 3.0, false},
                        Case{"white inside", "apriltag:tagStandard41h12", 5.0, 30.0, 0.8, 3.0, true},
                        Case{"large", "apriltag:tagCircle21h7", 14.0, 55.0, 1.2, 4.0, true}}) {
    MarkerScene scene = scene_of(c.family, 9, c.cell_px / std::cos(c.tilt_deg * std::numbers::pi / 180.0));
    scene.tilt_rad = c.tilt_deg * std::numbers::pi / 180.0;
    scene.tilt_axis_rad = 0.7;
    scene.blur_px = c.blur_px;
    scene.dark_on_bright = c.published;
    const std::vector<double> levels = tests::rendered(scene);
    constexpr int kSeeds = 100;
    double centre = 0.0;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const TagObservation tag =
          only(photograph(levels, scene.width_px, scene.height_px, {c.noise, static_cast<std::uint64_t>(seed)}), scene.family);
      ASSERT_EQ(tag.status, ObservationStatus::kCoded) << c.name;
      const Eigen::Vector2d e = tag.centre_px - scene.centre_px;
      centre += 0.5 * e.dot(tag.cov_px2.inverse() * e) / kSeeds;
      mean += e / kSeeds;
    }
    // 99.9 % bounds of chi-square with 200 degrees of freedom over 200 (normal approximation): 1 +- 3.29 sqrt(2 / 200).
    EXPECT_GT(centre, 0.671) << c.name;
    EXPECT_LT(centre, 1.329) << c.name;
    RecordProperty(c.name, std::to_string(centre));
    EXPECT_LT(mean.norm(), 0.005) << c.name;
  }
}

TEST(Tags, MirroredTagsAreRefusedAsWhatTheyAre) {
  for (const std::string& name : tag_families()) {
    MarkerScene scene = scene_of(name, 17, 6.0);
    scene.mirrored = true;
    const TagObservation tag = only(photograph(scene, {1.0, 4}), scene.family);
    EXPECT_EQ(tag.status, ObservationStatus::kRefused) << name;
    EXPECT_EQ(tag.id, 17) << name;
    EXPECT_TRUE(tag.mirrored);
  }
}

TEST(Tags, IdsOutOfUseAreRefusedAndTonesNotAskedForAreNotFound) {
  const MarkerScene scene = scene_of("apriltag:tag36h11", 5, 6.0);
  const base::Image image = photograph(scene, {1.0, 2});
  EXPECT_EQ(only(image, scene.family, {.ids = {5}}).status, ObservationStatus::kCoded);
  EXPECT_EQ(only(image, scene.family, {.ids = {6}}).status, ObservationStatus::kRefused);
  EXPECT_EQ(only(image, scene.family, {.polarity = Polarity::kDarkDots}).id, 5);
  EXPECT_TRUE(detect_tags(image.view(), scene.family, {.polarity = Polarity::kBrightDots})->empty());
}

TEST(Tags, TwelveBitImagesAreReadAsWell) {
  const MarkerScene scene = scene_of("apriltag:tagStandard41h12", 100, 5.0);
  std::vector<double> levels = tests::rendered(scene);
  for (double& level : levels) level *= 1500.0 / 255.0;  // exposed low
  const base::Image image = photograph(levels, scene.width_px, scene.height_px, {12.0, 3}, 16, 4095.0);
  const TagObservation tag = only(image, scene.family);
  EXPECT_EQ(tag.id, 100);
  EXPECT_EQ(tag.status, ObservationStatus::kCoded);
  EXPECT_LT(squared_error_in_sigmas(tag, scene), 18.4);
  EXPECT_LT((tag.centre_px - scene.centre_px).norm(), 0.05);
}

/// detect() hands the tag's centre on; there is no ellipse, so nothing is reduced later.
TEST(Tags, DetectGivesTheSameObservations) {
  const MarkerScene scene = scene_of("apriltag:tag25h9", 20, 5.0);
  const base::Image image = photograph(scene, {1.0, 8});
  const TagObservation tag = only(image, scene.family);
  const auto found = detect(image.view(), scene.family);
  ASSERT_TRUE(found && found->observations.size() == 1U);
  EXPECT_EQ(found->family, "apriltag:tag25h9");
  EXPECT_EQ(found->observations[0].id, 20);
  EXPECT_EQ(found->observations[0].centre_px, tag.centre_px);
  EXPECT_EQ(found->observations[0].cov_px2, tag.cov_px2);
  EXPECT_EQ(found->observations[0].semi_major_px, 0.0);
  EXPECT_FALSE(detect_tags(image.view(), *marker_family("ring10")));
}

/// Something that lies over a part of the tag: read where it may be, never as something else.
TEST(Tags, HiddenPartsGiveNoWrongId) {
  int coded = 0;
  for (std::size_t i = 0; i < 60; ++i) {
    MarkerScene scene = scene_of(i % 2 == 0 ? "apriltag:tag16h5" : "apriltag:tag36h11", i % 30, 6.0);
    std::vector<double> levels = tests::rendered(scene);
    const double direction = 0.41 * static_cast<double>(i);
    for (int y = 0; y < scene.height_px; ++y) {
      for (int x = 0; x < scene.width_px; ++x) {
        const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
        if (e.x() * std::cos(direction) + e.y() * std::sin(direction) > 6.0 * (0.5 + 0.08 * static_cast<double>(i))) {
          levels[static_cast<std::size_t>(y * scene.width_px + x)] = i % 3 == 0 ? scene.bright_level : scene.dark_level;
        }
      }
    }
    const auto found = detect_tags(photograph(levels, scene.width_px, scene.height_px, {2.0, i}).view(), scene.family);
    ASSERT_TRUE(found);
    for (const TagObservation& tag : *found) {
      if (tag.status != ObservationStatus::kCoded) continue;
      EXPECT_EQ(tag.id, static_cast<int>(i % 30));
      ++coded;
    }
  }
  EXPECT_GT(coded, 0);
}

TEST(TagLayout, FourQuarterTurnsLeadBackAndCodesStayApart) {
  for (const std::string& name : tag_families()) {
    const MarkerFamily family = *marker_family(name);
    const int promised = std::stoi(name.substr(name.rfind('h') + 1));
    for (std::size_t i = 0; i < std::min<std::size_t>(family.codes.size(), 12); ++i) {
      std::uint64_t code = family.codes[i].code;
      for (int quarter = 0; quarter < 4; ++quarter) code = quarter_turned(*family.tag, code, family.bits);
      EXPECT_EQ(code, family.codes[i].code) << name;
      for (std::size_t k = 0; k < i; ++k) {
        std::uint64_t other = family.codes[k].code;
        for (int quarter = 0; quarter < 4; ++quarter) {
          EXPECT_GE(std::popcount(other ^ family.codes[i].code), promised) << name;
          other = quarter_turned(*family.tag, other, family.bits);
        }
      }
    }
  }
}

}  // namespace
}  // namespace crosstie::markers
