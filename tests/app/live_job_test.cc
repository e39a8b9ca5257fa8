// What the operator's session reads and writes in a job folder: readings in job.toml, images that are there, images that are put aside.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/job_edit.h"
#include "app/live/job_scene.h"
#include "app/live/shots.h"
#include "base/file.h"
#include "base/image.h"
#include "base/pattern_sequence.h"
#include "scan/patterns.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::ElementsAre;
using testing::HasSubstr;

std::string edited(const std::string& text, const std::string& station, double axis_mm) {
  const auto result = with_station_axis(text, "job.toml", station, axis_mm);
  EXPECT_TRUE(result) << result.error().message;
  return result.value_or(std::string());
}

TEST(JobEdit, ChangesTheReadingAndNothingElse) {
  const std::string valid =
      "# \xC3\xA4\n[[station]]   # first\nname = \"x0\"\naxis_mm = 0   # as "
      "planned\n\n[[station]]\naxis_mm=8.5e2\nname=\"\xC3\xB6\"\n"
      "cross = { left = \"l.png\" }\n";
  EXPECT_EQ(edited(valid, "x0", 0.0068),
            "# \xC3\xA4\n[[station]]   # first\nname = \"x0\"\naxis_mm = 0.0068   # as planned\n\n[[station]]\naxis_mm=8.5e2\n"
            "name=\"\xC3\xB6\"\ncross = { left = \"l.png\" }\n");
  EXPECT_EQ(edited(valid, "\xC3\xB6", -850.04),
            "# \xC3\xA4\n[[station]]   # first\nname = \"x0\"\naxis_mm = 0   # as planned\n\n[[station]]\naxis_mm=-850.04\n"
            "name=\"\xC3\xB6\"\ncross = { left = \"l.png\" }\n");
}

TEST(JobEdit, WindowsLineEndsAndCharactersBeforeTheValueStay) {
  const std::string text =
      "station = [ { name = \"\xC3\xBC\xE2\x82\xAC\", axis_mm = 12.5 }, { name = \"b\", axis_mm = 3 } ]\r\nx = 1\r\n";
  EXPECT_EQ(edited(text, "\xC3\xBC\xE2\x82\xAC", 13.0),
            "station = [ { name = \"\xC3\xBC\xE2\x82\xAC\", axis_mm = 13.0 }, { name = \"b\", axis_mm = 3 } ]\r\nx = 1\r\n");
  EXPECT_EQ(edited(text, "b", 4.25),
            "station = [ { name = \"\xC3\xBC\xE2\x82\xAC\", axis_mm = 12.5 }, { name = \"b\", axis_mm = 4.25 } ]\r\nx = 1\r\n");
}

TEST(JobEdit, WhatIsNoStationIsRefused) {
  for (const char* text : {"", "[[station]]\nname = \"a\"\n", "[[station]]\nname = \"b\"\naxis_mm = 1\n", "station = 3\n",
                           "[[station]]\nname = \"a\"\naxis_mm = \"1\"\n"}) {
    const auto result = with_station_axis(text, "job.toml", "a", 1.0);
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(result.error().message, HasSubstr("job.toml: there is no station 'a'"));
  }
  const auto broken = with_station_axis("a = 1\nb = \n", "job.toml", "a", 1.0);
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error().message, HasSubstr("job.toml:2"));
}

class ShotsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    job_.folder = folder_.path();
    job_.file = folder_ / "job.toml";
    job_.cameras["left"].board_images = "board/left/*.png";
    job_.cameras["right"].board_images = "board/right/*.png";
    job_.board = JobBoard{};
  }
  void touch(const fs::path& path) const {
    ASSERT_TRUE(base::make_folder((folder_ / path).parent_path()));
    ASSERT_TRUE(base::write_file_atomically(folder_ / path, "x"));
  }

  tests::TemporaryFolder folder_;
  Job job_;
};

TEST_F(ShotsTest, PairsOfTheBoardAreCountedAndTheNextNumberIsFreeOnBothSides) {
  auto shots = board_shots(job_);
  ASSERT_TRUE(shots) << shots.error().message;
  EXPECT_TRUE(shots->taken.empty());
  EXPECT_EQ(shots->next[0].filename(), "01.png");
  for (const char* name : {"board/left/01.png", "board/right/01.png", "board/left/03.png", "board/right/03.png",
                           "board/left/02.png", "board/left/.taking/05.png"})
    touch(name);
  shots = board_shots(job_);
  ASSERT_TRUE(shots);
  ASSERT_EQ(shots->taken.size(), 2U) << "02 lacks its right image";
  EXPECT_EQ(shots->taken[1][1], folder_.path() / "board/right/03.png");
  EXPECT_EQ(shots->next[1], folder_.path() / "board/right/04.png") << "02 is taken on one side";
}

TEST_F(ShotsTest, PatternsThatNoImageCanBePutIntoAreRefused) {
  for (const char* pattern : {"board/left/one.png", "board/*/a*.png", "board/left/*_?.png", "board/left/*.tif"}) {
    job_.cameras["left"].board_images = pattern;
    const auto shots = board_shots(job_);
    ASSERT_FALSE(shots) << pattern;
    EXPECT_THAT(shots.error().message, HasSubstr("one asterisk"));
  }
  job_.board.reset();
  EXPECT_FALSE(board_shots(job_));
}

TEST_F(ShotsTest, AScanIsThereWhenAllImagesOfBothCamerasAre) {
  const auto sequence = scan::make_patterns({.width_px = 64, .height_px = 32, .periods_px = {16.0}, .steps = 4});
  ASSERT_TRUE(sequence);
  ASSERT_TRUE(base::make_folder(folder_ / "scan"));
  ASSERT_TRUE(base::write_pattern_manifest(folder_ / "scan/patterns.json", *sequence));
  job_.stations.push_back({"a",
                           1.0,
                           {{"left", "cross/a_l.png"}, {"right", "cross/a_r.png"}},
                           JobScan{"scan/a/left", "scan/a/right", "scan/patterns.json"}});
  const auto state = [&] {
    const auto stations = station_shots(job_);
    EXPECT_TRUE(stations) << stations.error().message;
    return stations ? stations->front() : StationShots{};
  };
  EXPECT_FALSE(state().cross_taken);
  touch("cross/a_l.png");
  EXPECT_FALSE(state().cross_taken) << "one of a pair is none";
  touch("cross/a_r.png");
  EXPECT_TRUE(state().cross_taken);
  for (std::size_t i = 0; i < sequence->patterns.size(); ++i) {
    EXPECT_FALSE(state().scan_taken);
    touch(fs::path("scan/a/left") / sequence->patterns[i].files[0]);
    touch(fs::path("scan/a/right") / sequence->patterns[i].files[1]);
  }
  EXPECT_TRUE(state().scan_taken);
  job_.stations[0].cross.pop_back();
  EXPECT_FALSE(station_shots(job_)) << "a cross that one camera sees is no station of a head";
}

TEST_F(ShotsTest, WhatIsPutAsideKeepsItsPathAndIsNeverOverwritten) {
  for (int round = 1; round <= 2; ++round) {
    touch("board/left/01.png");
    touch("scan/a/left/00.png");
    const auto aside =
        put_aside(folder_.path(), {folder_ / "board/left/01.png", folder_ / "board/right/01.png", folder_ / "scan/a/left"});
    ASSERT_TRUE(aside) << aside.error().message;
    EXPECT_EQ(aside->filename(), round == 1 ? "001" : "002");
    EXPECT_TRUE(fs::exists(*aside / "board/left/01.png"));
    EXPECT_TRUE(fs::exists(*aside / "scan/a/left/00.png"));
    EXPECT_FALSE(fs::exists(folder_ / "board/left/01.png"));
  }
  ASSERT_TRUE(base::make_folder(folder_ / "scan/b/left"));
  ASSERT_TRUE(put_aside(folder_.path(), {folder_ / "scan/b/left"}));
  EXPECT_FALSE(fs::exists(folder_ / "undone/003")) << "an empty folder is nothing that was taken";
  const auto outside = put_aside(folder_ / "board", {folder_ / "scan"});
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, ErrorCode::kUsage);
  EXPECT_TRUE(fs::exists(folder_ / "scan"));
}

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

}  // namespace
}  // namespace crosstie::app
