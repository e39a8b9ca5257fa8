#include "devices/axis_file.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/devices/manual_clock.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using std::chrono::seconds;
using ::testing::HasSubstr;

class AxisFileTest : public ::testing::Test {
 protected:
  /// The position that a file of these contents gives, seen by a reader that knows nothing yet.
  std::optional<double> first_seen(std::string_view contents) {
    const auto axis = *read_axis_file({folder_.write("fresh.txt", contents)}, clock_.clock());
    const AxisState state = axis->state();
    EXPECT_EQ(state.trouble.empty(), state.latest.has_value()) << state.trouble;
    return state.latest ? std::optional(state.latest->position_mm) : std::nullopt;
  }

  tests::TemporaryFolder folder_;
  tests::ManualClock clock_;
};

TEST_F(AxisFileTest, TheLastCompleteLineCounts) {
  EXPECT_EQ(first_seen("850.04\n"), 850.04);
  EXPECT_EQ(first_seen("1\n2\n850.04\r\n"), 850.04);
  EXPECT_EQ(first_seen("1\n850.04\n\n  \n"), 850.04);
  EXPECT_EQ(first_seen("\xef\xbb\xbf"
                       "850.04\r\n"),
            850.04);
  EXPECT_EQ(first_seen(fmt::format("{}850.04\n", std::string(1'000'000, '\n'))), 850.04);
  EXPECT_EQ(first_seen(fmt::format("{}\n850.04\n", std::string(100'000, '7'))), 850.04);
}

TEST_F(AxisFileTest, WhatIsNotCompleteOrNoPositionDoesNotCount) {
  EXPECT_EQ(first_seen(""), std::nullopt);
  EXPECT_EQ(first_seen("\n\n"), std::nullopt);
  EXPECT_EQ(first_seen("850.0"), std::nullopt);
  EXPECT_EQ(first_seen("850.04\n86"), std::nullopt);  // how old the first line is, nobody knows
  EXPECT_EQ(first_seen("850.04\nERROR\n"), std::nullopt);
  EXPECT_EQ(first_seen(fmt::format("{}\n", std::string(100'000, '7'))), std::nullopt);
  EXPECT_EQ(first_seen(std::string("\0\0\0\0\n", 5)), std::nullopt);
}

TEST_F(AxisFileTest, FollowsChangesAndOutlivesHalfWrittenLines) {
  const auto path = folder_.write("axis.txt", "100.0\n");
  const auto axis = *read_axis_file({path}, clock_.clock());
  EXPECT_EQ(axis->state().latest->position_mm, 100.0);
  const HostTime first = axis->state().latest->time;

  clock_.advance(seconds(10));
  std::ofstream(path, std::ios::app) << "20";
  const AxisState half = axis->state();
  EXPECT_EQ(half.latest->position_mm, 100.0);
  EXPECT_EQ(half.latest->time, first);  // the file changed, the reading did not
  EXPECT_THAT(half.trouble, HasSubstr("no line end"));

  std::ofstream(path, std::ios::app) << "0.5\n";
  EXPECT_EQ(axis->state().latest->position_mm, 200.5);
  EXPECT_GT(axis->state().latest->time, first);

  folder_.write("axis.txt", "");
  EXPECT_EQ(axis->state().latest->position_mm, 200.5);
  folder_.write("axis.txt", "300.0\n");
  EXPECT_EQ(axis->state().latest->position_mm, 300.0);
}

TEST_F(AxisFileTest, AFileThatGoesAwayLeavesAReadingThatAges) {
  const auto path = folder_.write("axis.txt", "100.0\n");
  const auto axis = *read_axis_file({path}, clock_.clock());
  ASSERT_TRUE(fresh_reading(axis->state(), clock_.now(), 60.0));
  std::filesystem::remove(path);
  clock_.advance(seconds(61));
  const auto stale = fresh_reading(axis->state(), clock_.now(), 60.0);
  ASSERT_FALSE(stale);
  EXPECT_THAT(stale.error().message, HasSubstr("axis.txt"));
  EXPECT_THAT(stale.error().message, HasSubstr("No such file"));

  folder_.write("axis.txt", "101.0\n");
  EXPECT_EQ(fresh_reading(axis->state(), clock_.now(), 60.0)->position_mm, 101.0);
}

TEST_F(AxisFileTest, AFileThatNobodyWroteForAnHourIsStaleFromTheFirstLook) {
  const auto path = folder_.write("axis.txt", "100.0\n");
  std::filesystem::last_write_time(path, std::filesystem::last_write_time(path) - std::chrono::hours(1));
  const auto axis = *read_axis_file({path}, clock_.clock());
  const AxisState state = axis->state();
  EXPECT_NEAR(seconds_between(state.latest->time, clock_.now()), 3600.0, 60.0);
  EXPECT_FALSE(fresh_reading(state, clock_.now(), 60.0));
}

TEST_F(AxisFileTest, AFileOfTheFutureAgesAsWell) {
  const auto path = folder_.write("axis.txt", "100.0\n");
  std::filesystem::last_write_time(path, std::filesystem::last_write_time(path) + std::chrono::hours(1));
  const auto axis = *read_axis_file({path}, clock_.clock());
  EXPECT_EQ(axis->state().latest->time, clock_.now());
  clock_.advance(seconds(61));
  EXPECT_FALSE(fresh_reading(axis->state(), clock_.now(), 60.0));
}

TEST_F(AxisFileTest, WhatIsNoFileIsTroubleAndNeverWaitedFor) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  for (const auto& path : {folder_ / "absent.txt", folder_.path(), folder_ / "pipe"}) {
    const auto axis = read_axis_file({path}, clock_.clock());
    ASSERT_TRUE(axis);
    const auto refused = fresh_reading((*axis)->state(), clock_.now(), 60.0);
    ASSERT_FALSE(refused) << path;
    EXPECT_EQ(refused.error().code, ErrorCode::kDevice);
  }
}

TEST_F(AxisFileTest, AFormatOutOfItsDomainIsRefused) {
  EXPECT_EQ(read_axis_file({folder_ / "axis.txt", {.mm_per_unit = 0.0}}).error().code, ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::devices
