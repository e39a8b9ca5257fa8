#include "devices/folder_watch.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/grey_png.h"
#include "tests/devices/manual_clock.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using tests::grey_png;

class FolderWatchTest : public ::testing::Test {
 protected:
  FolderWatch watch(const std::string& name = "shot_*.png", bool take_existing = false) {
    return FolderWatch({.pattern = folder_ / name, .rest_s = 0.3, .take_existing = take_existing}, clock_.clock());
  }
  /// What a look finds, as "key:grey level".
  std::vector<std::string> found(FolderWatch& watch) {
    const auto looked = watch.look();
    if (!looked) return {looked.error().message};
    std::vector<std::string> result;
    for (const WatchedImage& one : looked->images) {
      result.push_back(fmt::format("{}:{}", one.key, one.image.view().row<std::uint8_t>(0)[0]));
    }
    for (const base::Warning& warning : looked->warnings) result.push_back(warning.code);
    return result;
  }
  /// ... and after the files were at rest.
  std::vector<std::string> found_at_rest(FolderWatch& watch) {
    EXPECT_THAT(found(watch), IsEmpty());
    clock_.advance(milliseconds(300));
    return found(watch);
  }

  tests::TemporaryFolder folder_;
  tests::ManualClock clock_;
};

TEST_F(FolderWatchTest, AFileIsAnImageOnceItIsAtRest) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("shot_07.png", grey_png(7));
  EXPECT_THAT(found(folder), IsEmpty());
  clock_.advance(milliseconds(299));
  EXPECT_THAT(found(folder), IsEmpty());
  clock_.advance(milliseconds(1));
  EXPECT_THAT(found(folder), ElementsAre("07:7"));
  clock_.advance(milliseconds(1000));
  EXPECT_THAT(found(folder), IsEmpty());  // never twice
}

TEST_F(FolderWatchTest, AFileThatGrowsIsWaitedFor) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  const std::string bytes = grey_png(9);
  for (std::size_t size = 1; size < bytes.size(); size += 13) {
    folder_.write("shot_1.png", bytes.substr(0, size));
    EXPECT_THAT(found(folder), IsEmpty()) << size;
    clock_.advance(milliseconds(250));
  }
  folder_.write("shot_1.png", bytes);
  EXPECT_THAT(found_at_rest(folder), ElementsAre("1:9"));
}

TEST_F(FolderWatchTest, AWriterThatStopsHalfwayIsToldOfOnceAndMayGoOn) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  const std::string bytes = grey_png(9);
  folder_.write("shot_1.png", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT(found_at_rest(folder), ElementsAre("unreadable_image"));
  clock_.advance(milliseconds(1000));
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("shot_1.png", bytes);
  EXPECT_THAT(found_at_rest(folder), ElementsAre("1:9"));
}

TEST_F(FolderWatchTest, RenamedAndLinkedFilesAreNoNewImages) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("shot_1.png", grey_png(1));
  EXPECT_THAT(found_at_rest(folder), ElementsAre("1:1"));
  fs::rename(folder_ / "shot_1.png", folder_ / "shot_2.png");
  fs::create_hard_link(folder_ / "shot_2.png", folder_ / "shot_3.png");
  clock_.advance(milliseconds(1000));
  EXPECT_THAT(found(folder), IsEmpty());
  clock_.advance(milliseconds(1000));
  EXPECT_THAT(found(folder), IsEmpty());
}

TEST_F(FolderWatchTest, AFileThatIsRenamedBeforeItIsReadComesOnce) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("shot_1.png", grey_png(1));
  EXPECT_THAT(found(folder), IsEmpty());
  fs::rename(folder_ / "shot_1.png", folder_ / "shot_2.png");
  clock_.advance(milliseconds(300));
  EXPECT_THAT(found(folder), ElementsAre("2:1"));
  clock_.advance(milliseconds(300));
  EXPECT_THAT(found(folder), IsEmpty());
}

TEST_F(FolderWatchTest, ATemporaryNameThatIsRenamedAtTheEnd) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("shot_1.png.part", grey_png(1));
  EXPECT_THAT(found_at_rest(folder), IsEmpty());
  fs::rename(folder_ / "shot_1.png.part", folder_ / "shot_1.png");
  EXPECT_THAT(found_at_rest(folder), ElementsAre("1:1"));
}

TEST_F(FolderWatchTest, AFileThatIsWrittenAnewIsANewImage) {
  FolderWatch folder = watch("left.png");
  EXPECT_THAT(found(folder), IsEmpty());
  for (const int level : {1, 2, 3}) {
    folder_.write("left.png", grey_png(level));
    // As if time had passed between two writes: the clock of files ticks coarsely.
    fs::last_write_time(folder_ / "left.png", fs::file_time_type::clock::now() + std::chrono::seconds(level));
    EXPECT_THAT(found_at_rest(folder), ElementsAre(fmt::format(":{}", level)));
  }
}

TEST_F(FolderWatchTest, DeletedFilesAndFolders) {
  FolderWatch folder = watch("day/shot_*.png");
  EXPECT_THAT(found(folder), IsEmpty());  // no folder yet
  folder_.write("day/shot_1.png", grey_png(1));
  EXPECT_THAT(found(folder), IsEmpty());
  fs::remove(folder_ / "day/shot_1.png");
  clock_.advance(milliseconds(300));
  EXPECT_THAT(found(folder), IsEmpty());
  fs::remove_all(folder_ / "day");
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("day/shot_2.png", grey_png(2));
  EXPECT_THAT(found_at_rest(folder), ElementsAre("2:2"));
}

TEST_F(FolderWatchTest, RemembersNoMoreThanTheFolderHolds) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  std::size_t most = 0;
  for (int i = 0; i < 40; ++i) {  // other software that moves its images away once they were read
    const fs::path file = folder_.write(fmt::format("shot_{}.png", i), grey_png(i));
    EXPECT_THAT(found_at_rest(folder), ElementsAre(fmt::format("{}:{}", i, i)));
    fs::remove(file);
    clock_.advance(milliseconds(700));
    most = std::max(most, folder.remembered());
  }
  EXPECT_LE(most, 12u);  // one a second, those of ten seconds
  clock_.advance(milliseconds(10'001));
  EXPECT_THAT(found(folder), IsEmpty());
  EXPECT_EQ(folder.remembered(), 0u);
}

TEST_F(FolderWatchTest, WhatStaysIsRememberedForEver) {
  FolderWatch folder = watch("day/shot_*.png");
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("day/shot_1.png", grey_png(1));
  EXPECT_THAT(found_at_rest(folder), ElementsAre("1:1"));
  for (int i = 0; i < 5; ++i) {
    clock_.advance(std::chrono::minutes(1));
    EXPECT_THAT(found(folder), IsEmpty());
  }
  EXPECT_EQ(folder.remembered(), 1u);
  // A share that goes away and comes back with the images of before.
  fs::rename(folder_ / "day", folder_ / "night");
  for (int i = 0; i < 5; ++i) {
    clock_.advance(std::chrono::minutes(1));
    EXPECT_THAT(found(folder), IsEmpty());
  }
  fs::rename(folder_ / "night", folder_ / "day");
  EXPECT_THAT(found(folder), IsEmpty());
  EXPECT_THAT(found_at_rest(folder), IsEmpty());
  // A listing that missed the file once, as it may where the file is renamed meanwhile.
  fs::rename(folder_ / "day/shot_1.png", folder_ / "day/hidden");
  clock_.advance(milliseconds(9'000));
  EXPECT_THAT(found(folder), IsEmpty());
  fs::rename(folder_ / "day/hidden", folder_ / "day/shot_2.png");
  EXPECT_THAT(found(folder), IsEmpty());
  EXPECT_THAT(found_at_rest(folder), IsEmpty());
}

TEST_F(FolderWatchTest, FilesOfAnotherDayCountWhereWanted) {
  folder_.write("shot_1.png", grey_png(1));
  FolderWatch today = watch();
  EXPECT_THAT(found_at_rest(today), IsEmpty());
  FolderWatch all = watch("shot_*.png", true);
  EXPECT_THAT(found_at_rest(all), ElementsAre("1:1"));
}

TEST_F(FolderWatchTest, OtherNamesAndOtherThingsAreLeftAlone) {
  FolderWatch folder = watch("*.png");
  EXPECT_THAT(found(folder), IsEmpty());
  folder_.write("a.tif", grey_png(1));
  folder_.write(".b.png", grey_png(2));
  folder_.write("empty.png", "");
  fs::create_directory(folder_ / "folder.png");
  fs::create_symlink(folder_ / "nowhere", folder_ / "link.png");
  folder_.write("c.png", grey_png(3));
  EXPECT_THAT(found_at_rest(folder), ElementsAre("c:3"));
}

TEST_F(FolderWatchTest, ImagesComeInTheOrderOfTheirTimes) {
  FolderWatch folder = watch();
  EXPECT_THAT(found(folder), IsEmpty());
  const auto now = fs::file_time_type::clock::now();
  const std::pair<std::string, int> files[] = {{"b", 2}, {"c", 1}, {"a", 3}};
  for (const auto& [key, second] : files) {
    fs::last_write_time(folder_.write("shot_" + key + ".png", grey_png(second)), now + std::chrono::seconds(second));
  }
  EXPECT_THAT(found_at_rest(folder), ElementsAre("c:1", "b:2", "a:3"));
}

TEST(FolderWatchOptionsTest, OutOfTheirDomain) {
  for (const auto& pattern : {"", "folder/", "left_*_*.png", "*/left.png"}) {
    EXPECT_EQ(FolderWatchOptions{.pattern = pattern}.validate().error().code, ErrorCode::kUsage) << pattern;
  }
  EXPECT_EQ((FolderWatchOptions{.pattern = "*.png", .rest_s = -1.0}.validate().error().code), ErrorCode::kUsage);
  EXPECT_TRUE(FolderWatchOptions{.pattern = "folder/*.png"}.validate());
}

}  // namespace
}  // namespace crosstie::devices
