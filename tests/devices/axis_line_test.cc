#include "devices/axis_line.h"

#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;

struct Line {
  std::string text;
  AxisLineFormat format;
  double position_mm;
};

TEST(AxisLine, LinesOfRealControls) {
  const AxisLineFormat plain = {};
  const Line lines[] = {
      {"850.04", plain, 850.04},
      {"  -850.04 mm ", plain, -850.04},
      {"+  123.456", plain, 123.456},  // digital readouts: the sign in a column of its own
      {"-      0.5 mm", plain, -0.5},
      {"8.5004e2", plain, 850.04},
      {"X850.04 Y-12.000 Z3", {.label = "X"}, 850.04},
      {"N10 X 850.04", {.label = "X"}, 850.04},
      {"X2 100.0 X 850.04", {.label = "X"}, 850.04},
      {"<Idle|MPos:850.040,1.000,0.000|FS:0,0>", {.label = "MPos"}, 850.04},
      {"ABS_ACT_POS 850.04 12.5 0.0", {.label = "ABS_ACT_POS"}, 850.04},
      {"pos=850.04;state=3", {.label = "pos"}, 850.04},
      {"850040 um", {.unit = "um", .mm_per_unit = 0.001}, 850.04},
      {"1.5 in", {.unit = "in", .mm_per_unit = 25.4}, 38.1},
      {"100", {.mm_per_unit = -1.0, .zero_mm = 1000.0}, 900.0},
  };
  for (const Line& line : lines) {
    const auto position_mm = parse_axis_line(line.text, line.format);
    ASSERT_TRUE(position_mm) << line.text << ": " << position_mm.error().message;
    EXPECT_NEAR(*position_mm, line.position_mm, 1e-9) << line.text;
  }
}

TEST(AxisLine, WhatIsNoPositionIsRefused) {
  const AxisLineFormat plain = {};
  const std::pair<std::string, AxisLineFormat> lines[] = {
      {"", plain},
      {"mm", plain},
      {"nan", plain},
      {"inf mm", plain},
      {"1e999", plain},
      {"0x1A", plain},
      {"850.04.1", plain},
      {"--5", plain},
      {"+ -5", plain},
      {"850,04", plain},
      {"850 04", plain},
      {"850.04 in", plain},
      {"850.04 mm 3", plain},
      {"ERR 850.04", plain},
      {std::string("85\0.04", 6), plain},
      {"\xff\xfe\x00", plain},
      {"Y850.04", {.label = "X"}},
      {"X", {.label = "X"}},
      {"X ERROR", {.label = "X"}},
      {"X850,04 Y3", {.label = "X"}},
      {"X 33.5 in", {.label = "X"}},
      {"850.04", {.unit = "mm", .min_mm = 0.0, .max_mm = 800.0}},
      {fmt::format("{:>300}", "850.04"), plain},
  };
  for (const auto& [text, format] : lines) {
    const auto position_mm = parse_axis_line(text, format);
    ASSERT_FALSE(position_mm) << text << " was read as " << *position_mm;
    EXPECT_EQ(position_mm.error().code, ErrorCode::kBadInput) << text;
  }
}

TEST(AxisLine, TheMessageShowsTheLineInPrintableCharacters) {
  const auto refused = parse_axis_line(fmt::format("a{}\x1b[31m{:b>100}", '\0', ""), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("\"a\\x00\\x1b[31mbbb"));
  EXPECT_THAT(refused.error().message, HasSubstr("...\""));
  EXPECT_LT(refused.error().message.size(), 150u);
}

TEST(AxisLine, FormatsOutOfTheirDomain) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const AxisLineFormat& format :
       {AxisLineFormat{.label = "X Y"}, AxisLineFormat{.mm_per_unit = 0.0}, AxisLineFormat{.mm_per_unit = nan},
        AxisLineFormat{.zero_mm = nan}, AxisLineFormat{.min_mm = 5.0, .max_mm = 5.0}, AxisLineFormat{.min_mm = nan}}) {
    ASSERT_FALSE(format.validate());
    EXPECT_EQ(format.validate().error().code, ErrorCode::kUsage);
  }
  EXPECT_TRUE(AxisLineFormat{}.validate());
}

}  // namespace
}  // namespace crosstie::devices
