#include "base/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using tests::TemporaryFolder;

TEST(Table, ReadsAnySeparator) {
  for (const char* text :
       {"id,x_mm,note\n1,2.5,a\n", "id;x_mm;note\r\n1;2.5;a\r\n", "id\tx_mm\tnote\n1\t2.5\ta",
        "  id  x_mm  note \n 1 \t 2.5 a  \n", "\xEF\xBB\xBFid, x_mm ,note\n\n# comment\n1 ,2.5, a # said later\n\n",
        "# first\n\nid,x_mm,note\n1,2.5,\"a\"\n"}) {
    const auto table = parse_table("t", text);
    ASSERT_TRUE(table) << text << table.error().message;
    EXPECT_THAT(table->columns, ElementsAre("id", "x_mm", "note")) << text;
    ASSERT_EQ(table->rows.size(), 1U) << text;
    EXPECT_THAT(table->rows[0], ElementsAre("1", "2.5", "a")) << text;
  }
}

TEST(Table, ColumnsInBlanksMayBeAligned) {
  const auto table = parse_table("t", "  id    x_mm   y_mm\n   1     2.0    3.0\n  10    20.0   30.0\n");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_THAT(table->rows[1], ElementsAre("10", "20.0", "30.0"));
}

TEST(Table, KnowsTheLineOfEveryRow) {
  const auto table = parse_table("t", "a,b\n\n# c\n1,2\n\"x\ny\",3\n4,5\n");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_THAT(table->lines, ElementsAre(4, 5, 7));
  EXPECT_EQ(table->rows[1][0], "x\ny");
}

TEST(Table, EmptyCellsAreKept) {
  const auto table = parse_table("t", "a,b,c\n,,\n1,,3\n");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_THAT(table->rows[0], ElementsAre("", "", ""));
  EXPECT_THAT(table->rows[1], ElementsAre("1", "", "3"));
}

TEST(Table, RefusesWithFileAndLine) {
  struct Case {
    const char* text;
    const char* message;
  };
  for (const Case& c : {Case{"", "f.csv:1:"},
                        {"\n\n", "f.csv:1:"},
                        {"# only\n", "empty"},
                        {"a,b\n1\n", "f.csv:2: 1 cells"},
                        {"a,b\n1,2\n1,2,3\n", "f.csv:3: too many"},
                        {"a,b;c\n", "commas and semicolons"},
                        {"a,a\n", "two columns"},
                        {"a,,c\n", "no name"},
                        {"1,2,3\n4,5,6\n", "must name the columns"},
                        {"a,b\n\"1,2\n", "f.csv:2: a quotation mark"},
                        {"a,b\n1\"2,3\n", "quotation mark"},
                        {"a,b\n\"1\"2,3\n", "closing quotation mark"}}) {
    const auto table = parse_table("f.csv", c.text);
    ASSERT_FALSE(table) << c.text;
    EXPECT_EQ(table.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(table.error().message, HasSubstr("f.csv")) << c.text;
    EXPECT_THAT(table.error().message, HasSubstr(c.message)) << c.text;
  }
}

TEST(Table, NumbersAreCheckedCellByCell) {
  const auto table = parse_table("f.csv", "a;b\n1.5;2,5\n99999999999;nan\n-7;1e308\n");
  ASSERT_TRUE(table);
  EXPECT_EQ(*table->number(0, 0), 1.5);
  const auto comma = table->number(0, 1);
  ASSERT_FALSE(comma);
  EXPECT_THAT(comma.error().message, HasSubstr("f.csv:2: b reads \"2,5\""));
  EXPECT_THAT(comma.error().message, HasSubstr("decimal"));
  EXPECT_FALSE(table->integer(0, 0));
  EXPECT_FALSE(table->integer(1, 0));
  EXPECT_FALSE(table->number(1, 1));
  EXPECT_EQ(*table->integer(2, 0), -7);
  EXPECT_EQ(*table->number(2, 1), 1e308);
  EXPECT_EQ(table->column("b"), 1U);
  EXPECT_FALSE(table->column("c"));
}

TEST(Table, WhatIsWrittenReadsBack) {
  const TemporaryFolder folder;
  Table table;
  table.columns = {"plain", "odd"};
  for (const char* cell : {"", "a,b", "a;b", "say \"hi\"", " blanks ", "two\nlines", "#5", "tab\there", "\xC3\xBC"})
    table.rows.push_back({"x", cell});
  ASSERT_TRUE(write_table(folder / "t.csv", table));
  const auto again = read_table(folder / "t.csv");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->columns, table.columns);
  EXPECT_EQ(again->rows, table.rows);
}

TEST(Table, LongLinesAndManyRowsAreRead) {
  std::string text = "id,note\n1," + std::string(1000000, 'n') + "\n";
  for (int i = 0; i < 100000; ++i) text += "2,b\n";
  const auto table = parse_table("t", text);
  ASSERT_TRUE(table);
  EXPECT_EQ(table->rows.size(), 100001U);
  EXPECT_EQ(table->rows[0][1].size(), 1000000U);
  const auto bad = table->number(0, 1);
  ASSERT_FALSE(bad);
  EXPECT_LT(bad.error().message.size(), 200U);
}

}  // namespace
}  // namespace crosstie::base
