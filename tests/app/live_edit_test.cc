// A reading that goes into a job.toml as its author wrote it, and images that leave their place.
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/job_edit.h"
#include "app/live/shots.h"
#include "base/file.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::HasSubstr;

/// Texts in which «VALUE» stands for the reading of station b: the expected result comes from the text itself.
const std::vector<std::string> kTexts = {
    "[[station]]\nname = \"b\"\naxis_mm = «VALUE»",
    "[[station]]\nname = \"b\"\naxis_mm = «VALUE»\n",
    "[[station]]\r\nname = \"b\"\r\naxis_mm = «VALUE»\r\n[[station]]\r\nname = \"c\"\r\naxis_mm = 1\r\n",
    "[[station]]\nname = \"b\"\naxis_mm =«VALUE»   \t \n# the end\n",
    "[[station]]\n\taxis_mm\t=\t«VALUE»#close\n\tname = 'b'\n",
    "\xEF\xBB\xBF[[station]]\nname = \"b\"\naxis_mm = «VALUE» # with a byte order mark\n",
    "\xEF\xBB\xBFstation = [{name = \"a\", axis_mm = 1}, {name = \"b\", axis_mm = «VALUE»}]\n",
    "station = [\n  { name = \"b\", axis_mm = «VALUE» }, # \xF0\x9F\x9A\x80\n]\n",
    "station = [{note = \"\xC3\xA4\xE2\x82\xAC\xF0\x9F\x9A\x80\", name = \"b\", axis_mm = «VALUE», x = \"\xC3\x9F\"}]\n",
    "station = [{name = \"e\xCC\x81\", axis_mm = 2}, {name = \"b\", \"axis_mm\" = «VALUE»}]  # combined\n",
    "text = \"\"\"\n[[station]]\nname = \"b\"\naxis_mm = 5\n\"\"\"\n[[station]]\nname = \"b\"\naxis_mm = «VALUE»\n",
    "# axis_mm = 3\n[[station]]\nname = \"a\"\naxis_mm = 7\n[station.scan]\nleft = \"axis_mm = 4\"\n[[station]]\naxis_mm = "
    "«VALUE»\nname = \"b\"\n[station.cross]\naxis_mm = 9\n"};

std::string with(const std::string& text, const std::string& value) {
  static const std::string kMark = "«VALUE»";
  std::string filled = text;
  filled.replace(filled.find(kMark), kMark.size(), value);
  return filled;
}

TEST(JobEdit, EveryByteButTheReadingStays) {
  for (const std::string& text : kTexts) {
    for (const char* before : {"0", "850", "-850.125", "+3", "8.5e2", "1_000.5", "1E-3", "0x1F", "-0.0"}) {
      const auto edited = with_station_axis(with(text, before), "job.toml", "b", 12.25);
      ASSERT_TRUE(edited) << edited.error().message << "\n" << with(text, before);
      EXPECT_EQ(*edited, with(text, "12.25"));
      const auto again = with_station_axis(*edited, "job.toml", "b", -1e-3);
      ASSERT_TRUE(again);
      EXPECT_EQ(*again, with(text, "-0.001"));
    }
  }
}

TEST(JobEdit, WhatIsWrittenIsWhatIsReadBack) {
  const std::string text = "[[station]]\nname = \"b\"\naxis_mm = 1\n";
  for (const double axis_mm : {0.1, 1.0 / 3.0, 123456.789012345, 1e-9, -2500.0, 850.0400000000001}) {
    const auto edited = with_station_axis(text, "job.toml", "b", axis_mm);
    ASSERT_TRUE(edited);
    const std::size_t at = edited->rfind("= ") + 2;
    EXPECT_EQ(std::stod(edited->substr(at)), axis_mm) << *edited;
    EXPECT_NE(edited->find_first_of(".e", at), std::string::npos) << "a TOML float: " << *edited;
  }
}

TEST(JobEdit, AFileThatSaysSoAlreadyIsLeftAlone) {
  const tests::TemporaryFolder folder;
  const std::string text = "[[station]]\r\nname = \"b\"\r\naxis_mm = 1.5  # kept\r\n";
  const fs::path file = folder.write("job.toml", text);
  const auto long_ago = fs::last_write_time(file) - std::chrono::hours(1);
  fs::last_write_time(file, long_ago);
  ASSERT_TRUE(write_station_axis(file, "b", 1.5));
  EXPECT_EQ(fs::last_write_time(file), long_ago);
  ASSERT_TRUE(write_station_axis(file, "b", 1.75));
  EXPECT_EQ(tests::read_all(file), "[[station]]\r\nname = \"b\"\r\naxis_mm = 1.75  # kept\r\n");
  EXPECT_NE(fs::last_write_time(file), long_ago);
  EXPECT_FALSE(write_station_axis(file, "c", 1.0));
  EXPECT_EQ(tests::read_all(file), "[[station]]\r\nname = \"b\"\r\naxis_mm = 1.75  # kept\r\n");
  EXPECT_EQ(write_station_axis(folder / "none.toml", "b", 1.0).error().code, ErrorCode::kFileSystem);
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
