#include <algorithm>

#include <gtest/gtest.h>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

// Every id of the small families through renderer and detector, in both tones, each at a rotation of its own.

namespace crosstie::markers {
namespace {

class RoundTrip : public testing::TestWithParam<std::string> {};

TEST_P(RoundTrip, EveryIdComesBackInBothTonesFromAnyRotation) {
  tests::MarkerScene scene;
  scene.family = *marker_family(GetParam());
  scene.samples_per_px = 4;
  scene.radius_px = scene.family.tag ? 4.0 : 5.0;
  const double reach_px = scene.family.tag ? 0.71 * (scene.family.tag->total_cells + 2) * scene.radius_px
                                           : scene.family.border_outer * scene.radius_px;
  scene.width_px = scene.height_px = static_cast<int>(2.0 * reach_px) + 8;
  scene.centre_px = Eigen::Vector2d::Constant(0.5 * scene.width_px - 0.3);
  scene.blur_px = 0.6;
  for (const bool dark : {false, true}) {
    scene.dark_on_bright = dark;
    for (std::size_t i = 0; i < scene.family.codes.size(); ++i) {
      scene.code = scene.family.codes[i].code;
      scene.roll_rad = 2.399963 * static_cast<double>(i) + (dark ? 1.0 : 0.0);  // the golden angle
      const auto found = detect(tests::photograph(scene, {2.0, i}).view(), scene.family);
      ASSERT_TRUE(found);
      int coded = 0;
      for (const base::Observation& one : found->observations) {
        if (one.status != base::ObservationStatus::kCoded) continue;
        ++coded;
        EXPECT_EQ(one.id, scene.family.codes[i].id) << dark;
      }
      EXPECT_EQ(coded, 1) << scene.family.codes[i].id << ' ' << dark;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(SmallFamilies, RoundTrip,
                         testing::Values("ring10", "aicon12", "aicon14", "agisoft12", "agisoft14", "apriltag:tag16h5",
                                         "apriltag:tag25h9", "apriltag:tagCircle21h7"),
                         [](const auto& family) {
                           std::string name = family.param;
                           std::replace(name.begin(), name.end(), ':', '_');
                           return name;
                         });

}  // namespace
}  // namespace crosstie::markers
