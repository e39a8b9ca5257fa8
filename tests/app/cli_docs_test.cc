// docs/cli.md is made from the table of verbs; this test keeps it true. CROSSTIE_UPDATE_DOCS=1 writes it anew.

#include <cstdlib>
#include <fstream>
#include <string>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "app/verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

/// Text of a table's cell: bars escaped.
std::string cell(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|') escaped.push_back('\\');
    escaped.push_back(c);
  }
  return escaped;
}

std::string verb_section(const Verb& verb) {
  std::string text = fmt::format("\n## {}\n\n{}.\n\n```\n{}\n```\n\n| option | value | effect |\n| --- | --- | --- |\n",
                                 verb.name, verb.summary, verb.example);
  for (const Option& option : verb.options) {
    text += fmt::format("| `{}`{} | {} | {} |\n", cell(option.name),
                        option.required   ? " (required)"
                        : option.repeated ? " (repeatable)"
                                          : "",
                        option.value.empty() ? "" : fmt::format("`{}`", cell(option.value)), cell(option.help));
  }
  return text;
}

std::string cli_page() {
  std::string text = R"(# Command line

`crosstie VERB ...`: one executable, one word for each kind of work. Results go to stdout, talk to stderr; `crosstie VERB --help`
shows this page's options. Every verb also takes `--quiet` (nothing on stderr but errors) and `--threads N` (0 = all cores; results
do not depend on it).

| exit code | meaning |
| --- | --- |
| 0 | done, every verdict OK or WARNING |
| 1 | done, but a verdict is FAIL |
| 2 | the call is wrong: unknown option, contradictory options |
| 3 | bad input: a damaged file, an unknown key in a job, measurements out of their domain |
| 4 | the observations do not determine what was asked for; the message names what is weak |
| 5 | the system: a file cannot be read or written, memory or threads do not suffice |
| 6 | a device does not answer |
| 70 | a defect of crosstie |
| 130 | stopped by Ctrl-C or SIGTERM; nothing half-written is left |
)";
  for (const Verb& verb : verbs()) text += verb_section(verb);
  return text;
}

TEST(CommandLinePage, SaysWhatTheTableOfVerbsSays) {
  const std::filesystem::path page = std::filesystem::path(CROSSTIE_SOURCE_DIR) / "docs" / "cli.md";
  if (std::getenv("CROSSTIE_UPDATE_DOCS") != nullptr) std::ofstream(page) << cli_page();
  EXPECT_EQ(tests::read_all(page), cli_page()) << "run test_app once with CROSSTIE_UPDATE_DOCS=1";
}

}  // namespace
}  // namespace crosstie::app
