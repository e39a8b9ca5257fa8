#include "base/text.h"

#include <bit>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace crosstie::base {
namespace {

TEST(Text, ReadsFiniteNumbers) {
  EXPECT_EQ(parse_double("1.5"), 1.5);
  EXPECT_EQ(parse_double("  -2e3\r\n"), -2000.0);
  EXPECT_EQ(parse_double("+.5"), 0.5);
  EXPECT_EQ(parse_double("1e308"), 1e308);
  EXPECT_EQ(parse_int(" +42 "), 42);
  EXPECT_EQ(parse_int("-9223372036854775808"), std::numeric_limits<std::int64_t>::min());
}

TEST(Text, RefusesEverythingElse) {
  for (const char* text : {"",
                           " ",
                           "1,5",
                           "1.5x",
                           "x",
                           "nan",
                           "inf",
                           "-inf",
                           "infinity",
                           "1e309",
                           "0x10",
                           "1 2",
                           "--1",
                           "+-1",
                           "-+1",
                           "+",
                           "-",
                           ".",
                           "e5",
                           "1e",
                           "1_000",
                           "1'000",
                           "\xC2\xA0"
                           "1"}) {
    EXPECT_FALSE(parse_double(text)) << text;
  }
  for (const char* text : {"", "1.0", "1e3", "9223372036854775808", "0x1", "abc", "1,000", "+-1"})
    EXPECT_FALSE(parse_int(text)) << text;
}

TEST(Text, NumbersComeBackExactly) {
  std::mt19937_64 random(12);
  for (int i = 0; i < 20000; ++i) {
    const double value = std::bit_cast<double>(random());
    if (!std::isfinite(value) || std::fpclassify(value) == FP_SUBNORMAL) continue;
    const auto again = parse_double(format_double(value));
    ASSERT_TRUE(again) << format_double(value);
    EXPECT_EQ(*again, value);
  }
  EXPECT_EQ(format_double(0.1), "0.1");
  EXPECT_EQ(format_double(1e-7), "1e-07");
  EXPECT_EQ(format_double(-0.0), "-0");
  EXPECT_EQ(format_double(std::numeric_limits<double>::quiet_NaN()), "nan");
  EXPECT_EQ(format_double(-std::numeric_limits<double>::infinity()), "-inf");
}

TEST(Text, TrimsAndSplits) {
  EXPECT_EQ(trim(" \t a b \r\n"), "a b");
  EXPECT_EQ(trim(" \t"), "");
  const auto parts = split("a,,b,", ',');
  ASSERT_EQ(parts.size(), 4U);
  EXPECT_EQ(parts[1], "");
  EXPECT_EQ(parts[3], "");
  EXPECT_EQ(split("", ',').size(), 1U);
}

TEST(Text, FindsTheWordThatWasMeant) {
  const std::vector<std::string> words = {"family", "ids", "exclude_ids", "dot_diameter_mm", "thickness_mm"};
  EXPECT_EQ(nearest_word("famliy", words), "family");
  EXPECT_EQ(nearest_word("Family", words), "family");
  EXPECT_EQ(nearest_word("exclude_id", words), "exclude_ids");
  EXPECT_EQ(nearest_word("dot_diametre_mm", words), "dot_diameter_mm");
  EXPECT_EQ(nearest_word("id", words), "ids");
  EXPECT_FALSE(nearest_word("temperature", words));
  EXPECT_FALSE(nearest_word("", words));
  EXPECT_FALSE(nearest_word("x", {"y"})) << "nothing in common";
  EXPECT_FALSE(nearest_word(std::string(1000000, 'a'), words));
}

}  // namespace
}  // namespace crosstie::base
