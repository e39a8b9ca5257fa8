// Images that a job has and lacks, and images that leave their place.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/shots.h"
#include "base/file.h"
#include "base/pattern_sequence.h"
#include "scan/patterns.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::HasSubstr;

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

TEST(PutAside, AllOrNothing) {
  const tests::TemporaryFolder folder;
  const fs::path job = folder / "job";
  const fs::path inside = folder.write("job/board/01.png", "in");
  const fs::path outside = folder.write("other/01.png", "out");
  for (const fs::path& path : {outside, job / "board/../../other/01.png", job, job / "."}) {
    const auto refused = put_aside(job, {inside, path});
    ASSERT_FALSE(refused) << path;
    EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
    EXPECT_THAT(refused.error().message, HasSubstr("not in the job's folder"));
    EXPECT_EQ(tests::read_all(inside), "in") << "with " << path;
    EXPECT_EQ(tests::read_all(outside), "out");
    EXPECT_FALSE(fs::exists(job / "undone"));
  }
}

TEST(PutAside, ARelativeJobFolderAndPathsThatWindAreTheSame) {
  const tests::TemporaryFolder folder;
  const fs::path here = fs::current_path();
  fs::current_path(folder.path());
  folder.write("scan/a/00.png", "x");
  folder.write("scan/b/00.png", "y");
  const auto aside = put_aside(".", {"scan/b/../a"});
  fs::current_path(here);
  ASSERT_TRUE(aside) << aside.error().message;
  EXPECT_EQ(tests::read_all(folder / "undone/001/scan/a/00.png"), "x");
}

TEST(BoardShots, WhatIsNoFileIsNoShotButItsNumberIsTaken) {
  const tests::TemporaryFolder folder;
  Job job;
  job.folder = folder.path();
  job.file = folder / "job.toml";
  job.board = JobBoard{};
  job.cameras["left"].board_images = "l/pose_*_x.png";
  job.cameras["right"].board_images = "r/pose_*_x.png";
  for (const char* side : {"l", "r"}) {
    for (const char* name : {"pose_02_x.png", "pose_x.png", "pose_2_x.png.tmp", "spose_03_x.png", "pose_03.png"})
      folder.write(fs::path(side) / name, "x");
    fs::create_directories(folder / side / "pose_01_x.png");
  }
  const auto shots = board_shots(job);
  ASSERT_TRUE(shots) << shots.error().message;
  ASSERT_EQ(shots->taken.size(), 1U);
  EXPECT_EQ(shots->taken[0][1], folder / "r/pose_02_x.png");
  EXPECT_EQ(shots->next[0], folder / "l/pose_03_x.png");
}

}  // namespace
}  // namespace crosstie::app
