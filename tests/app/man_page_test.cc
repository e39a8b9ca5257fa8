// Man pages say what the table of verbs says, and the programs that show man pages find nothing wrong with them.

#include "app/man_page.h"

#include <cstdlib>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/command_line.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::HasSubstr;

bool is_there(const std::string& program) { return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0; }

struct Page {
  std::string name;
  std::string text;
};

std::vector<Page> pages() {
  std::vector<Page> all = {{"crosstie", man_page(verbs())}};
  for (const Verb& verb : verbs()) all.push_back({"crosstie-" + verb.name, man_page(verb)});
  return all;
}

/// Runs a command on the file of each page; what it says of it.
std::string said_by(const std::string& command, const Page& page) {
  const tests::TemporaryFolder folder;
  const auto file = folder.write(page.name + ".1", page.text);
  const std::string line = fmt::format(fmt::runtime(command), file.string()) + " >'" + (folder / "said").string() + "' 2>&1";
  const int status = std::system(line.c_str());
  return (status == 0 ? "" : fmt::format("status {}: ", status)) + tests::read_all(folder / "said");
}

TEST(ManPages, SayWhatTheCommandLinePageSays) {
  const std::string cli = tests::read_all(std::filesystem::path(CROSSTIE_SOURCE_DIR) / "docs" / "cli.md");
  for (const ExitStatus& status : exit_statuses())
    EXPECT_THAT(cli, HasSubstr(fmt::format("| {} | {} |", status.code, status.meaning)));
}

TEST(ManPages, AreWhatTheProgramPrints) {
  const auto index = parse_command_line({"help", "--man"}, verbs());
  ASSERT_TRUE(index);
  EXPECT_EQ(index->text, man_page(verbs()));
  const auto scan = parse_command_line({"help", "--man", "scan"}, verbs());
  ASSERT_TRUE(scan);
  EXPECT_THAT(scan->text, HasSubstr("\\-\\-max\\-depth\\-mm"));
  EXPECT_EQ(parse_command_line({"help", "scan"}, verbs())->text, parse_command_line({"scan", "--help"}, verbs())->text);
  const auto wrong = parse_command_line({"help", "--man", "stich"}, verbs());
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().message, HasSubstr("did you mean 'stitch'"));
  EXPECT_FALSE(parse_command_line({"help", "--nonsense"}, verbs()));
}

/// What a reader sees, letter by letter: every option with its text, and the example as it stands in the table.
TEST(ManPages, ShowEveryOptionAndTheExample) {
  if (!is_there("mandoc")) GTEST_SKIP() << "no mandoc";
  for (const Verb& verb : verbs()) {
    const std::string shown = said_by("mandoc -T utf8 -O width=1000 '{}' | col -bxx", {verb.name, man_page(verb)});
    for (const Option& option : verb.options) {
      EXPECT_THAT(shown, HasSubstr(option.name)) << verb.name;
      EXPECT_THAT(shown, HasSubstr(option.help)) << verb.name;
    }
    EXPECT_THAT(shown, HasSubstr(verb.example.substr(0, verb.example.find('\n')))) << verb.name;
  }
}

TEST(ManPages, AreCleanForMandoc) {
  if (!is_there("mandoc")) GTEST_SKIP() << "no mandoc";
  for (const Page& page : pages()) {
    // No date: releases are dated by their changelog.
    const std::string said = said_by("mandoc -T lint -W warning '{}' | grep -v 'missing date' || true", page);
    EXPECT_EQ(said, "") << page.name;
  }
}

TEST(ManPages, AreCleanForGroff) {
  if (!is_there("groff")) GTEST_SKIP() << "no groff";
  for (const Page& page : pages()) EXPECT_EQ(said_by("groff -man -ww -z -T utf8 -rLL=120n '{}'", page), "") << page.name;
}

}  // namespace
}  // namespace crosstie::app
