// The fuzzers' inputs once more, with whatever compiler the tests have: the corpus that they have grown, and what they once found.
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>

#include "tests/fuzz/targets.h"
#include "tests/support/bounded.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::fuzz {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// What is being replayed when the process dies.
fs::path replayed;

class Replay : public testing::TestWithParam<Target> {
 protected:
  static std::size_t replay(const fs::path& folder) {
    const auto files = files_in(folder);
    for (const fs::path& file : files) {
      const tests::Bounded bounded;
      replayed = file;
      const std::string bytes = tests::read_all(file);
      EXPECT_EQ(GetParam().run(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()), 0) << file;
    }
    return files.size();
  }
};

TEST_P(Replay, CorpusAndWhatWasFound) {
  EXPECT_GT(replay(fs::path(CROSSTIE_FUZZ_CORPUS) / GetParam().name), 100U) << "the corpus is missing";
  replay(fs::path(CROSSTIE_SOURCE_DIR) / "tests/fuzz/found" / GetParam().name);
}

INSTANTIATE_TEST_SUITE_P(Targets, Replay, testing::ValuesIn(targets()),
                         [](const auto& target) { return std::string(target.param.name); });

/// expect() of a target aborts: say of which input.
const bool says_what = [] {
  std::signal(SIGABRT, [](int) { std::fprintf(stderr, "while replaying %s\n", replayed.c_str()); });
  return true;
}();

}  // namespace
}  // namespace crosstie::fuzz
