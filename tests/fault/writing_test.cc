// Every verb that writes is killed, and its calls of the system refused, at many places: what it writes is there as it was or as it will be,
// never in between; nothing else is left once it has run again. CROSSTIE_FAULT_SOAK=1 tries every place instead of some.
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <map>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/fault/faulty_program.h"
#include "tests/fault/work.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

bool all_places() { return std::getenv("CROSSTIE_FAULT_SOAK") != nullptr; }

/// Of so many calls those that are tried: all, or some, each from another part of them, and the last one, when the result is in its place.
std::vector<long> places(long calls, long some, unsigned seed) {
  std::vector<long> chosen;
  std::mt19937 random(seed);
  if (all_places()) some = calls;
  for (long k = 0; k < some; ++k) {
    const long from = 1 + calls * k / some;
    const long to = calls * (k + 1) / some;
    if (to >= from) chosen.push_back(from + static_cast<long>(random() % static_cast<unsigned long>(to - from + 1)));
  }
  if (!all_places()) chosen.back() = calls;
  return chosen;
}

/// A work with its earlier and its new result; made once for all tests of it.
struct Prepared {
  TemporaryFolder folder;
  Files before, after;
  long calls = 0;
  std::string trouble;
};

Ended run_on(const Work& work, const std::filesystem::path& folder, const std::string& what) {
  auto words = words_in(work, folder);
  words.insert(words.end(), {"--threads", "1"});  // the calls come in the same order each time
  return run_with(words, at_call(what, folder));
}

const Prepared& prepared(const Work& work) {
  static std::map<std::string, Prepared> all;
  const auto [at, is_new] = all.try_emplace(work.name);
  Prepared& it = at->second;
  if (!is_new) return it;
  if (!work.make(it.folder.path())) it.trouble = "not made";
  if (work.change) {
    if (const Ended first = run_on(work, it.folder.path(), "count"); first.exit_code != 0) it.trouble = first.err;
    work.change(it.folder.path());
  }
  it.before = files_in(it.folder.path());
  const Ended second = run_on(work, it.folder.path(), "count");
  if (second.exit_code != 0) it.trouble = second.err;
  it.calls = second.calls;
  it.after = files_in(it.folder.path());
  if (it.trouble.empty() && it.before == it.after) it.trouble = "a result like the earlier one would show no mix";
  return it;
}

class Writing : public testing::TestWithParam<Work> {
 protected:
  void SetUp() override {
    ASSERT_EQ(work_.trouble, "");
    RecordProperty("calls", std::to_string(work_.calls));
  }
  ~Writing() override { RecordProperty("cases", cases_); }

  [[nodiscard]] const std::filesystem::path& folder() const { return work_.folder.path(); }
  [[nodiscard]] Ended run(const std::string& what) const { return run_on(GetParam(), folder(), what); }

  /// Each output is old or new, and nothing else is there; a killed process may leave hidden names.
  void expect_old_or_new(bool killed) const {
    const Files now = files_in(folder());
    for (const std::string& output : GetParam().outputs) {
      const Files part = part_of(now, output);
      if (!killed && output.ends_with("index.html") && part.contains(output)) {  // it tells what a run that failed has done
        EXPECT_TRUE(part.at(output).find("</html>") != std::string::npos) << output;
        continue;
      }
      EXPECT_TRUE(part == part_of(work_.before, output) || part == part_of(work_.after, output))
          << output << ": " << differences(part_of(work_.after, output), part);
    }
    for (const auto& [name, contents] : now) {
      const bool hidden = name.starts_with('.') || name.find("/.") != std::string::npos;
      EXPECT_TRUE(work_.before.contains(name) || work_.after.contains(name) || (killed && hidden)) << "left behind: " << name;
    }
  }

  void expect_done_by_repetition() const {
    const Ended again = run("count");
    EXPECT_TRUE(again.exit_code == 0 || (GetParam().again != 0 && again.exit_code == GetParam().again)) << again.err;
    EXPECT_EQ(differences(work_.after, files_in(folder())), "");
  }

  const Prepared& work_ = prepared(GetParam());
  int cases_ = 0;
};

TEST_P(Writing, KilledAnywhereIsDoneByTheNextRun) {
  for (const long place : places(work_.calls, 4, 1)) {
    SCOPED_TRACE(fmt::format("killed at call {} of {}", place, work_.calls));
    ++cases_;
    restore(folder(), work_.before);
    EXPECT_EQ(run(fmt::format("kill:{}", place)).signal, SIGKILL);
    expect_old_or_new(true);
    expect_done_by_repetition();
  }
}

TEST_P(Writing, AFullDiskIsToldOnOneLine) {
  // From one call on (the disk is full) and at one call only (a sector is bad).
  for (const auto& [how, number, words] : {std::tuple{"from", ENOSPC, "No space left on device"},
                                           {"fail", EIO, "Input/output error"},
                                           {"from", EROFS, "Read-only file system"},
                                           {"from", EDQUOT, "Disk quota exceeded"}}) {
    for (const long place : places(work_.calls, number == ENOSPC ? 3 : 1, static_cast<unsigned>(number))) {
      SCOPED_TRACE(fmt::format("{} at call {} of {}", words, place, work_.calls));
      ++cases_;
      restore(folder(), work_.before);
      const Ended ended = run(fmt::format("{}:{}:{}", how, place, number));
      expect_old_or_new(false);
      if (ended.exit_code == 0) {  // what failed was not needed: to sync a folder, to remove what is hidden
        EXPECT_EQ(differences(work_.after, files_in(folder())), "") << "it says that it is done";
        continue;
      }
      EXPECT_EQ(ended.exit_code, 5) << ended.err;
      const std::size_t at = ended.err.rfind("crosstie: ");
      ASSERT_NE(at, std::string::npos) << ended.err;
      EXPECT_THAT(ended.err.substr(at), testing::HasSubstr(words));
      EXPECT_EQ(ended.err.find('\n', at), ended.err.size() - 1) << ended.err;
    }
  }
}

TEST_P(Writing, WritesThatTakeLessAreGoneOnWith) {
  restore(folder(), work_.before);
  EXPECT_EQ(run("short:0").exit_code, 0);
  EXPECT_EQ(differences(work_.after, files_in(folder())), "");
  ++cases_;
}

TEST_P(Writing, OnFileSystemsThatOnlyHaveFilesWithNames) {
  ++cases_;
  restore(folder(), work_.before);
  Fault fault = at_call("count", folder());
  fault.environment["CROSSTIE_FAULT_NAMED"] = "1";
  const Ended ended = run_with(words_in(GetParam(), folder()), fault);
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(differences(work_.after, files_in(folder())), "");
}

TEST_P(Writing, TheSameBytesEachTimeAndForAnyNumberOfThreads) {
  for (const char* threads : {"1", "64"}) {
    SCOPED_TRACE(threads);
    ++cases_;
    restore(folder(), work_.before);
    auto words = words_in(GetParam(), folder());
    words.insert(words.end(), {"--threads", threads});
    const Ended ended = run_with(words);
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_EQ(differences(work_.after, files_in(folder())), "");
  }
}

INSTANTIATE_TEST_SUITE_P(Program, Writing, testing::ValuesIn(works()),
                         [](const auto& tested) { return name_of(tested.param); });

}  // namespace
}  // namespace crosstie::tests
