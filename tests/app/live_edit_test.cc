// A reading that goes into a job.toml as its author wrote it.
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/job_edit.h"
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

}  // namespace
}  // namespace crosstie::app
