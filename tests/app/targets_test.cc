#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/app/run_verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::TemporaryFolder;

struct Said {
  std::string out;
  std::string error;
};

Said targets(std::vector<std::string> words) {
  words.insert(words.begin(), "targets");
  const tests::VerbAnswer answer = tests::run_verb(words);
  return {answer.out, answer.error ? answer.error->message : ""};
}

TEST(Targets, ListsTheFamilyOrAPartOfIt) {
  const std::string all = targets({"--family", "ring10", "--list"}).out;
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 54);
  EXPECT_EQ(targets({"--family", "aicon14", "--list", "--ids", "1-2"}).out, "1 129\n2 135\n");
  const std::string some = targets({"--family", "aicon14", "--list", "--count", "20"}).out;
  EXPECT_EQ(std::count(some.begin(), some.end(), '\n'), 20);
}

TEST(Targets, WritesSheets) {
  const TemporaryFolder folder;
  const std::string pdf = (folder / "a.pdf").string();
  const std::string svg = (folder / "a.svg").string();
  EXPECT_EQ(targets({"--family", "ring10", "--ids", "0-127", "--out", pdf}).out, pdf + "\n");
  EXPECT_TRUE(tests::read_all(pdf).starts_with("%PDF"));
  EXPECT_EQ(targets({"--family", "ring10", "--count", "3", "--out", svg}).out, svg + "\n");
  EXPECT_THAT(tests::read_all(svg), HasSubstr("</svg>"));
  const std::string numbered =
      (folder / "a-1.svg").string() + "\n" + (folder / "a-2.svg").string() + "\n" + (folder / "a-3.svg").string() + "\n";
  EXPECT_EQ(targets({"--family", "ring10", "--ids", "0-127", "--out", svg}).out, numbered);
}

TEST(Targets, RefusesWhatMakesNoSense) {
  const TemporaryFolder folder;
  const std::string pdf = (folder / "a.pdf").string();
  EXPECT_THAT(targets({"--family", "ring10"}).error, HasSubstr("--list or --out"));
  EXPECT_THAT(targets({"--family", "ring10", "--out", pdf}).error, HasSubstr("which of the 54 ids"));
  EXPECT_THAT(targets({"--family", "ring10", "--list", "--ids", "5000"}).error, HasSubstr("no id 5000"));
  EXPECT_THAT(targets({"--family", "ring10", "--ids", "1,1x", "--out", pdf}).error, HasSubstr("--ids"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "55", "--out", pdf}).error, HasSubstr("1 to 54"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "0", "--out", pdf}).error, HasSubstr("1 to 54"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "5", "--out", (folder / "a.png").string()}).error,
              HasSubstr(".pdf or .svg"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "5", "--out", pdf, "--page", "a5"}).error, HasSubstr("--page"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "5", "--out", pdf, "--polarity", "grey"}).error,
              HasSubstr("--polarity"));
  EXPECT_THAT(targets({"--family", "ring10", "--count", "5", "--out", pdf, "--dot-diameter-mm", "0"}).error,
              HasSubstr("positive"));
  EXPECT_FALSE(fs::exists(pdf));
}

}  // namespace
}  // namespace crosstie::app
