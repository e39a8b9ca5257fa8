#include "markers/detect.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using base::Observation;
using base::ObservationStatus;
using tests::MarkerScene;
using tests::photograph;

MarkerScene scene_of(const char* family, std::size_t index = 0) {
  MarkerScene scene;
  scene.family = *marker_family(family);
  scene.code = scene.family.codes.at(index).code;
  return scene;
}

/// The only observation in the photograph.
Observation only(const base::Image& image, const MarkerFamily& family, const DetectOptions& options = {}) {
  const auto found = detect(image.view(), family, options);
  EXPECT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->observations.size(), 1U);
  return found->observations.empty() ? Observation{} : found->observations.front();
}

TEST(Detect, ReadsEveryRing10Code) {
  MarkerScene scene = scene_of("ring10");
  for (std::size_t i = 0; i < scene.family.codes.size(); ++i) {
    scene.code = scene.family.codes[i].code;
    scene.roll_rad = 0.1 + 0.37 * static_cast<double>(i);
    const Observation found = only(photograph(scene, {2.0, i}), scene.family);
    EXPECT_EQ(found.status, ObservationStatus::kCoded);
    EXPECT_EQ(found.id, scene.family.codes[i].id);
    EXPECT_GT(found.margin, 0.6);
    EXPECT_LT((found.centre_px - scene.centre_px).norm(), 0.03);
  }
}

TEST(Detect, ReadsBothPolaritiesAndBothDepths) {
  for (const char* family : {"ring10", "aicon12", "aicon14", "agisoft12", "agisoft14"}) {
    MarkerScene scene = scene_of(family, 31);
    for (const bool dark : {false, true}) {
      scene.dark_on_bright = dark;
      const auto levels = tests::rendered(scene);
      const Observation in8 = only(photograph(levels, 96, 96, {1.0, 1}), scene.family);
      EXPECT_EQ(in8.id, scene.family.codes[31].id) << family << dark;
      EXPECT_EQ(in8.status, ObservationStatus::kCoded);
      std::vector<double> levels12 = levels;
      for (double& level : levels12) level *= 4095.0 / 255.0;
      const Observation in16 = only(photograph(levels12, 96, 96, {16.0, 2}, 16, 4095.0), scene.family);
      EXPECT_EQ(in16.id, scene.family.codes[31].id) << family << dark;
      EXPECT_LT((in16.centre_px - scene.centre_px).norm(), 0.02);
      EXPECT_NEAR(in16.semi_major_px, scene.radius_px, 0.03);
    }
  }
}

TEST(Detect, ReadsTiltedMarkersAndMeasuresTheirEllipse) {
  MarkerScene scene = scene_of("aicon14", 100);
  scene.radius_px = 10.0;
  for (const double tilt_deg : {20.0, 45.0, 60.0}) {
    for (const double axis_rad : {0.0, 0.7, 1.5, 2.9}) {
      scene.tilt_rad = tilt_deg * std::numbers::pi / 180.0;
      scene.tilt_axis_rad = axis_rad;
      const Observation found = only(photograph(scene, {1.0, 3}), scene.family);
      EXPECT_EQ(found.id, scene.family.codes[100].id) << tilt_deg << " " << axis_rad;
      EXPECT_EQ(found.status, ObservationStatus::kCoded);
      EXPECT_NEAR(found.semi_major_px, 10.0, 0.03);
      EXPECT_NEAR(found.semi_minor_px, 10.0 * std::cos(scene.tilt_rad), 0.03);
      EXPECT_NEAR(std::remainder(found.angle_rad - axis_rad, std::numbers::pi), 0.0, 0.03);
    }
  }
}

TEST(Detect, ReadsLargeAndSmallMarkers) {
  for (const double radius_px : {4.0, 20.0, 60.0}) {
    MarkerScene scene = scene_of("ring10", 20);
    scene.radius_px = radius_px;
    scene.width_px = scene.height_px = static_cast<int>(8.0 * radius_px);
    scene.centre_px = {4.0 * radius_px + 0.3, 4.0 * radius_px - 0.2};
    const Observation found = only(photograph(scene, {1.5, 4}), scene.family);
    EXPECT_EQ(found.id, scene.family.codes[20].id) << radius_px;
    EXPECT_EQ(found.status, ObservationStatus::kCoded);
    EXPECT_LT((found.centre_px - scene.centre_px).norm(), 0.03);
  }
}

TEST(Detect, ReadsInUnevenLight) {
  MarkerScene scene = scene_of("aicon14", 200);
  scene.light_slope = {0.015, -0.01};  // from 0.3 to 1.7 times across the marker
  const Observation found = only(photograph(scene, {1.0, 5}), scene.family);
  EXPECT_EQ(found.status, ObservationStatus::kCoded);
  EXPECT_EQ(found.id, scene.family.codes[200].id);
  EXPECT_LT((found.centre_px - scene.centre_px).norm(), 0.02);
}

TEST(Detect, FindsPlainDots) {
  MarkerScene scene = scene_of("aicon14");
  scene.coded = false;
  const Observation found = only(photograph(scene, {2.0, 6}), scene.family);
  EXPECT_EQ(found.status, ObservationStatus::kUncoded);
  EXPECT_EQ(found.id, base::kNoId);
  EXPECT_LT((found.centre_px - scene.centre_px).norm(), 0.03);
}

TEST(Detect, RefusesIdsThatAreNotInUse) {
  const MarkerScene scene = scene_of("ring10", 7);
  const int id = scene.family.codes[7].id;
  EXPECT_EQ(only(photograph(scene), scene.family, {.ids = {id}}).status, ObservationStatus::kCoded);
  const Observation refused = only(photograph(scene), scene.family, {.ids = {id + 1, id + 2}});
  EXPECT_EQ(refused.status, ObservationStatus::kRefused);
  EXPECT_EQ(refused.id, id);
}

TEST(Detect, CountsOverAndUnderExposedPixels) {
  base::Image image(100, 50, 8);
  for (int x = 0; x < 25; ++x) {
    for (int y = 0; y < 50; ++y) image.row<std::uint8_t>(y)[x] = 255;
  }
  for (int x = 25; x < 50; ++x) {
    for (int y = 0; y < 50; ++y) image.row<std::uint8_t>(y)[x] = 128;
  }
  const auto found = detect(image.view(), *marker_family("ring10"));
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->saturated_fraction, 0.25);
  EXPECT_DOUBLE_EQ(found->dark_fraction, 0.5);
  EXPECT_TRUE(found->observations.empty());
}

TEST(Detect, RefusesOptionsOutOfTheirDomainAndEmptyImages) {
  const MarkerFamily family = *marker_family("ring10");
  const base::Image image(64, 64, 8);
  const auto error_of = [&](const DetectOptions& options) {
    const auto found = detect(image.view(), family, options);
    EXPECT_FALSE(found);
    EXPECT_EQ(found.error().code, base::ErrorCode::kUsage);
    return found ? std::string() : found.error().message;
  };
  EXPECT_THAT(error_of({.min_radius_px = 0.0}), testing::HasSubstr("min_radius_px"));
  EXPECT_THAT(error_of({.min_axis_ratio = 2.0}), testing::HasSubstr("min_axis_ratio"));
  EXPECT_THAT(error_of({.min_margin = -1.0}), testing::HasSubstr("min_margin"));
  EXPECT_THAT(error_of({.saturated_level = 0.0}), testing::HasSubstr("saturated_level"));
  const auto empty = detect(base::ImageView{}, family);
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().code, base::ErrorCode::kBadInput);
}

TEST(Detect, StopsWhenAskedTo) {
  const MarkerScene scene = scene_of("ring10", 7);
  std::stop_source stop;
  stop.request_stop();
  const auto found = detect(photograph(scene).view(), scene.family, {}, {{}, stop.get_token()});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, base::ErrorCode::kCancelled);
}

}  // namespace
}  // namespace crosstie::markers
