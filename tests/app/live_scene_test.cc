// The 3D view's scene: the rim in pieces, points of clouds.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/job_scene.h"
#include "base/cloud.h"
#include "base/file.h"
#include "base/ply.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(JobScene, ARimIsCutWhereAGapBeginsAndCloses) {
  const tests::TemporaryFolder folder;
  ASSERT_TRUE(base::write_file_atomically(folder / "edge.csv",
                                          "s_mm,x_mm,y_mm,z_mm\n0,0,0,0\n10,10,0,0\n20,20,0,0\n50,20,30,0\n60,10,30,0\n"));
  const auto pieces_of = [&](const std::string& result) {
    EXPECT_TRUE(base::write_file_atomically(folder / "result.json", result));
    return read_rim(folder.path());
  };
  const auto closed = pieces_of(R"({"closed": true, "gaps": [{"from_mm": 20.0, "length_mm": 30.0}]})");
  ASSERT_EQ(closed.size(), 3U);
  EXPECT_THAT(std::vector<bool>({closed[0].gap, closed[1].gap, closed[2].gap}), ElementsAre(false, true, false));
  EXPECT_EQ(closed[0].p_in_machine_mm.size(), 3U);
  EXPECT_EQ(closed[1].p_in_machine_mm.size(), 2U);
  EXPECT_EQ(closed[2].p_in_machine_mm.back(), Eigen::Vector3d(0.0, 0.0, 0.0)) << "back to the begin";
  const auto open = pieces_of(R"({"closed": false, "gaps": []})");
  ASSERT_EQ(open.size(), 1U);
  EXPECT_EQ(open[0].p_in_machine_mm.size(), 5U);
  const auto open_with_gap = pieces_of(R"({"closed": false, "gaps": [{"from_mm": 60.0, "length_mm": 31.6}]})");
  ASSERT_EQ(open_with_gap.size(), 2U);
  EXPECT_TRUE(open_with_gap[1].gap);
  EXPECT_TRUE(read_rim(folder / "nowhere").empty());
}

TEST(JobScene, PointsAreLittleEndianFloatsInBase64) {
  const ScenePatch patch{"a", 0.0, {{1.0, 2.0, 3.0}}};
  LiveScene scene{.version = 3, .frame = "machine"};
  scene.patches.push_back({&patch, base::Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, -3.0)}});
  // 1.0f 2.0f 0.0f: 00 00 80 3f 00 00 00 40 00 00 00 00
  EXPECT_THAT(scene_json(scene), HasSubstr("\"AACAPwAAAEAAAAAA\""));
}

TEST(JobScene, OfALargeCloudEverySoManyThPointIsShown) {
  const tests::TemporaryFolder folder;
  for (const std::size_t size : {std::size_t{3}, kPatchPoints, kPatchPoints + 1, 5 * kPatchPoints - 1}) {
    base::Cloud cloud;
    for (std::size_t i = 0; i < size; ++i) cloud.points.emplace_back(static_cast<double>(i), 0.5, -2.0);
    ASSERT_TRUE(base::write_ply(folder / "cloud.ply", cloud));
    const auto patch = read_patch(folder.path(), "a", 12.0);
    ASSERT_TRUE(patch) << patch.error().message;
    EXPECT_EQ(patch->station, "a");
    EXPECT_EQ(patch->axis_mm, 12.0);
    EXPECT_LE(patch->p_in_rig_mm.size(), kPatchPoints);
    EXPECT_GE(patch->p_in_rig_mm.size(), std::min(size, kPatchPoints / 2)) << size;
    const double step = patch->p_in_rig_mm[1].x();
    for (std::size_t i = 0; i < patch->p_in_rig_mm.size(); i += 97)
      EXPECT_EQ(patch->p_in_rig_mm[i], Eigen::Vector3d(step * static_cast<double>(i), 0.5, -2.0));
    EXPECT_GT(patch->p_in_rig_mm.back().x() + step, static_cast<double>(size) - 1.0) << "up to the end";
  }
  EXPECT_FALSE(read_patch(folder / "nowhere", "a", 0.0));
}

}  // namespace
}  // namespace crosstie::app
