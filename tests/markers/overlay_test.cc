#include "markers/overlay.h"

#include <gtest/gtest.h>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using Rgb = std::array<int, 3>;

Rgb pixel(const base::ColourImage& picture, int x, int y) {
  const std::size_t i =
      3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x));
  return {picture.rgb[i], picture.rgb[i + 1], picture.rgb[i + 2]};
}

TEST(Overlay, PaintsOverExposedRedAndUnderExposedBlue) {
  base::Image image(40, 10, 16);
  image.set_white_level(4095.0);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 40; ++x) image.row<std::uint16_t>(y)[x] = x < 10 ? 4095 : x < 20 ? 2048 : 10;
  }
  const base::ColourImage picture = overlay(image.view(), {});
  EXPECT_EQ(picture.width, 40);
  EXPECT_EQ(picture.rgb.size(), 3U * 400U);
  EXPECT_EQ(pixel(picture, 5, 5), (Rgb{255, 0, 0}));
  EXPECT_EQ(pixel(picture, 15, 5), (Rgb{127, 127, 127}));
  const Rgb dark = pixel(picture, 30, 5);
  EXPECT_EQ(dark[0], 0);
  EXPECT_GT(dark[2], 100);
}

TEST(Overlay, OutlinesCodedMarkersGreenAndPlainDotsCyan) {
  tests::MarkerScene scene;
  scene.family = *marker_family("ring10");
  scene.code = scene.family.codes[3].code;
  scene.radius_px = 10.0;
  for (const bool coded : {true, false}) {
    scene.coded = coded;
    const base::Image image = tests::photograph(scene);
    const auto found = detect(image.view(), scene.family);
    ASSERT_TRUE(found);
    const base::ColourImage picture = overlay(image.view(), *found);
    int green = 0, cyan = 0;
    for (int y = 0; y < 96; ++y) {
      for (int x = 0; x < 96; ++x) {
        const Rgb p = pixel(picture, x, y);
        if (p[1] > 200 && p[0] < 60) ++(p[2] < 60 ? green : cyan);
      }
    }
    EXPECT_EQ(green > 20, coded);
    EXPECT_EQ(cyan > 20, !coded);
  }
}

}  // namespace
}  // namespace crosstie::markers
