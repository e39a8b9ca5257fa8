// bash itself completes lines by the script that `crosstie help --bash-completion` prints.

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/command_line.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;
using testing::UnorderedElementsAre;

class Completion : public testing::Test {
 protected:
  void SetUp() override {
    const auto script = parse_command_line({"help", "--bash-completion"}, verbs());
    ASSERT_TRUE(script) << script.error().message;
    folder_.write("completion", script->text);
    folder_.write("here/left/00.png", "");
    folder_.write("here/two words/00.png", "");
    folder_.write("here/list.csv", "");
  }

  /// What bash offers for the last of the words, sorted.
  [[nodiscard]] std::vector<std::string> offered(const std::vector<std::string>& words) const {
    std::string line = "crosstie";
    for (const std::string& word : words) line += " '" + word + "'";
    folder_.write("ask", "set -u; cd '" + (folder_ / "here").string() + "'; source ../completion; COMP_WORDS=(" + line +
                             "); COMP_CWORD=" + std::to_string(words.size()) +
                             "; _crosstie; ((${#COMPREPLY[@]} == 0)) || printf '%s\\n' \"${COMPREPLY[@]}\"\n");
    const std::string command =
        "bash --norc '" + (folder_ / "ask").string() + "' >'" + (folder_ / "answer").string() + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << tests::read_all(folder_ / "answer");
    std::istringstream answer(tests::read_all(folder_ / "answer"));
    std::vector<std::string> lines;
    for (std::string text; std::getline(answer, text);) lines.push_back(text);
    std::sort(lines.begin(), lines.end());
    return lines;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Completion, OffersVerbs) {
  std::vector<std::string> names;
  for (const Verb& verb : verbs()) names.push_back(verb.name);
  EXPECT_THAT(offered({""}), IsSupersetOf(names));
  EXPECT_THAT(offered({"sti"}), ElementsAre("stitch"));
  EXPECT_THAT(offered({"help", "ca"}), ElementsAre("calibrate"));
}

TEST_F(Completion, OffersEveryOptionOfEveryVerb) {
  for (const Verb& verb : verbs()) {
    std::vector<std::string> options = {"--quiet", "--threads", "--help"};
    for (const Option& option : verb.options) {
      if (option.name.starts_with("--")) options.push_back(option.name);
    }
    std::sort(options.begin(), options.end());
    EXPECT_EQ(offered({verb.name, "--"}), options) << verb.name;
  }
  EXPECT_THAT(offered({"scan", "job", "--quiet", "--thick"}), ElementsAre("--thickness-mm"));
}

TEST_F(Completion, OffersValuesOfKnownLists) {
  EXPECT_THAT(offered({"targets", "--page", ""}), ElementsAre("a3", "a4", "letter"));
  EXPECT_THAT(offered({"targets", "--family", "ring"}), ElementsAre("ring10"));
  EXPECT_THAT(offered({"targets", "--family=aicon2"}), ElementsAre("aicon20"));
  EXPECT_THAT(offered({"verify", "--unit", "m"}), ElementsAre("m", "mm"));
  EXPECT_THAT(offered({"fit", "c"}), ElementsAre("circle", "cone", "cylinder"));
  EXPECT_THAT(offered({"run", "job", "--to", "com"}), ElementsAre("commission"));
  EXPECT_THAT(offered({"scan", "--min-depth-mm", ""}), IsEmpty());
}

TEST_F(Completion, TellsPlacesFromValuesOfOptions) {
  EXPECT_THAT(offered({"fit", "--radius-mm", "50", "--robust", "sph"}), ElementsAre("sphere"));
  EXPECT_THAT(offered({"fit", "sphere", "li"}), ElementsAre("list.csv"));
  EXPECT_THAT(offered({"fit", "sphere", "list.csv", "li"}), IsEmpty());
  EXPECT_THAT(offered({"stitch", "--surface-only", "a.ply", "li"}), ElementsAre("list.csv"));
}

TEST_F(Completion, OffersFilesAndFolders) {
  EXPECT_THAT(offered({"scan", "--left", ""}), UnorderedElementsAre("left", "two words"));
  EXPECT_THAT(offered({"scan", "--manifest", ""}), UnorderedElementsAre("left", "list.csv", "two words"));
  EXPECT_THAT(offered({"detect", "a.png", "b.png", "left/"}), ElementsAre("left/00.png"));
  EXPECT_THAT(offered({"simulate", "--scene", ""}), IsSupersetOf({"segment", "list.csv"}));
}

/// The list that a shell completes and the words of the help are one: neither knows a value that the other does not say.
TEST(OptionDomains, AreNamedInTheHelp) {
  for (const Verb& verb : verbs()) {
    for (const Option& option : verb.options) {
      if (option.value == "FAMILY" || option.value == "STEP") continue;  // the help shows some of many
      for (const std::string& word : option.domain)
        EXPECT_THAT(option.help, testing::HasSubstr(word)) << verb.name << ' ' << option.name;
    }
  }
}

TEST(OptionDomains, LeaveNoPlaceWithoutCompletion) {
  const auto script = parse_command_line({"help", "--bash-completion"}, verbs());
  ASSERT_TRUE(script);
  std::istringstream lines(script->text);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("places=(") == std::string::npos) continue;
    EXPECT_THAT(line, Not(testing::HasSubstr("''")));
  }
}

}  // namespace
}  // namespace crosstie::app
