#include "app/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::app {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

base::Result<Invocation> parse(const std::vector<std::string>& words) { return parse_command_line(words, verbs()); }

TEST(CommandLine, GivesVerbAndArguments) {
  const auto parsed = parse({"detect", "--family", "ring10", "a.png", "b.png", "--out", "found", "--threads", "2", "--quiet"});
  ASSERT_TRUE(parsed) << parsed.error().message;
  EXPECT_EQ(parsed->verb->name, "detect");
  EXPECT_THAT(parsed->arguments.all("IMAGE"), ElementsAre("a.png", "b.png"));
  EXPECT_EQ(parsed->arguments.get("--family"), "ring10");
  EXPECT_EQ(parsed->threads, 2);
  EXPECT_TRUE(parsed->quiet);
  EXPECT_FALSE(parsed->arguments.has("--timings"));
}

TEST(CommandLine, TakesRepeatedOptions) {
  const auto parsed =
      parse({"init", "--images", "d", "--camera", "l=L_*", "--camera", "r=R_*", "--family", "ring10", "--out", "job"});
  ASSERT_TRUE(parsed) << parsed.error().message;
  EXPECT_THAT(parsed->arguments.all("--camera"), ElementsAre("l=L_*", "r=R_*"));
}

TEST(CommandLine, ShowsHelpAndVersionAsText) {
  for (const auto& words : {std::vector<std::string>{}, {"--help"}, {"--version"}, {"adjust", "--help"}}) {
    const auto parsed = parse(words);
    ASSERT_TRUE(parsed);
    EXPECT_EQ(parsed->verb, nullptr);
    EXPECT_FALSE(parsed->text.empty());
  }
  EXPECT_THAT(parse({"adjust", "--help"})->text, HasSubstr("$ crosstie adjust"));
}

TEST(CommandLine, RefusesWithAUsageErrorThatHelps) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"adjsut", "job"}, "did you mean 'adjust'"},     {{"run"}, "JOB"},
      {{"adjust", "job", "--nonsense"}, "--nonsense"},  {{"detect", "a.png", "--out", "x"}, "--family"},
      {{"run", "job", "--threads", "many"}, "threads"},
  };
  for (const auto& [words, expected] : cases) {
    const auto parsed = parse(words);
    ASSERT_FALSE(parsed) << expected;
    EXPECT_EQ(parsed.error().code, base::ErrorCode::kUsage);
    EXPECT_THAT(parsed.error().message, HasSubstr(expected));
  }
}

TEST(Arguments, ReadsNumbersOrSaysWhich) {
  Arguments arguments;
  arguments.add("--focal-mm", "24.5");
  arguments.add("--seed", "x");
  EXPECT_EQ(arguments.number("--focal-mm")->value(), 24.5);
  EXPECT_FALSE(arguments.number("--absent")->has_value());
  EXPECT_THAT(arguments.integer("--seed").error().message, HasSubstr("--seed"));
}

}  // namespace
}  // namespace crosstie::app
