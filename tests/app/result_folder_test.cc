#include "app/result_folder.h"

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;

std::size_t entries(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(ResultFolder, ReplacesTheOldResultAsAWhole) {
  const tests::TemporaryFolder folder;
  folder.write("adjust/result.json", "old");
  folder.write("adjust/left_over.csv", "old");
  {
    auto result = ResultFolder::begin(folder / "adjust");
    ASSERT_TRUE(result) << result.error().message;
    std::ofstream(result->path() / "result.json") << "new";
    EXPECT_EQ(tests::read_all(folder / "adjust/result.json"), "old");
    ASSERT_TRUE(result->commit());
  }
  EXPECT_EQ(tests::read_all(folder / "adjust/result.json"), "new");
  EXPECT_FALSE(fs::exists(folder / "adjust/left_over.csv"));
  EXPECT_EQ(entries(folder.path()), 1U) << "nothing may be left beside the result";
}

TEST(ResultFolder, LeavesTheOldResultWithoutCommit) {
  const tests::TemporaryFolder folder;
  folder.write("adjust/result.json", "old");
  {
    auto result = ResultFolder::begin(folder / "adjust");
    ASSERT_TRUE(result);
    std::ofstream(result->path() / "result.json") << "half";
  }
  EXPECT_EQ(tests::read_all(folder / "adjust/result.json"), "old");
  EXPECT_EQ(entries(folder.path()), 1U);
}

TEST(ResultFolder, KeepsFilesOfTheOldResultOnRequest) {
  const tests::TemporaryFolder folder;
  folder.write("detect/result.json", "old");
  folder.write("detect/overlay/a.png", "picture");
  auto result = ResultFolder::begin(folder / "detect");
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->keep("overlay/a.png"));
  EXPECT_FALSE(result->keep("overlay/b.png"));
  ASSERT_TRUE(result->commit());
  EXPECT_EQ(tests::read_all(folder / "detect/overlay/a.png"), "picture");
}

TEST(ResultFolder, RefusesAFolderWithOtherFiles) {
  const tests::TemporaryFolder folder;
  folder.write("mine/thesis.tex", "years of work");
  const auto result = ResultFolder::begin(folder / "mine");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kFileSystem);
  EXPECT_EQ(tests::read_all(folder / "mine/thesis.tex"), "years of work");
}

TEST(ResultFolder, RefusesAFileAndASecondWriter) {
  const tests::TemporaryFolder folder;
  folder.write("plain", "");
  EXPECT_FALSE(ResultFolder::begin(folder / "plain"));
  const auto first = ResultFolder::begin(folder / "adjust");
  ASSERT_TRUE(first);
  EXPECT_FALSE(ResultFolder::begin(folder / "adjust"));
}

}  // namespace
}  // namespace crosstie::app
