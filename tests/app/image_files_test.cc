#include "app/image_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::HasSubstr;

TEST(Pattern, FitsStarsAndQuestionMarks) {
  EXPECT_TRUE(fits_pattern("043_0005_Scaled.tif", "043_*"));
  EXPECT_TRUE(fits_pattern("a.b.png", "*.png"));
  EXPECT_TRUE(fits_pattern("aab", "*ab"));
  EXPECT_TRUE(fits_pattern("abc", "a?c"));
  EXPECT_TRUE(fits_pattern("", "**"));
  EXPECT_FALSE(fits_pattern("043.tif", "671_*"));
  EXPECT_FALSE(fits_pattern("abc", "a?"));
  EXPECT_FALSE(fits_pattern("abc", "abcd"));
  // Bounded time on a pattern that a naive matcher needs ages for.
  EXPECT_FALSE(fits_pattern(std::string(5000, 'a'), "*a*a*a*a*a*a*a*b"));
}

TEST(MatchFiles, TakesImagesOnlySortedByName) {
  const tests::TemporaryFolder folder;
  for (const char* name : {"L_2.png", "L_1.PNG", "L_3.txt", "R_1.png", "L_4.tiff"}) folder.write(name, "x");
  const auto files = match_files(folder / "L_*");
  ASSERT_TRUE(files);
  ASSERT_EQ(files->size(), 3U);
  EXPECT_EQ((*files)[0].filename(), "L_1.PNG");
  EXPECT_EQ((*files)[2].filename(), "L_4.tiff");
}

TEST(MatchFiles, SaysWhatIsMissing) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(match_files(folder / "*.png").error().code, base::ErrorCode::kBadInput);
  EXPECT_THAT(match_files(folder / "*.png").error().message, HasSubstr("*.png"));
  EXPECT_THAT(match_files(folder / "absent" / "*.png").error().message, HasSubstr("absent"));
}

TEST(NameImages, UsesTheStemWhereItIsUnique) {
  const auto named = name_images({{{}, "left", "l/001.png"}, {{}, "right", "r/001.png"}, {{}, "right", "r/002.png"}});
  ASSERT_TRUE(named);
  EXPECT_EQ((*named)[0].name, "002");
  EXPECT_EQ((*named)[1].name, "left/001");
  EXPECT_EQ((*named)[2].name, "right/001");
}

TEST(NameImages, RefusesTheSameFileTwice) {
  EXPECT_FALSE(name_images({{{}, "left", "l/001.png"}, {{}, "right", "l/001.png"}}));
}

}  // namespace
}  // namespace crosstie::app
