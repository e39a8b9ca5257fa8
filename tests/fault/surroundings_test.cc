// What surrounds the program: signals, other runs, clock, locale, memory, threads, names of folders, formats of other versions.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/fault/faulty_program.h"
#include "tests/fault/work.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

void expect_one_line(const Ended& ended, int exit_code, const std::string& words) {
  EXPECT_EQ(ended.exit_code, exit_code) << "signal " << ended.signal << ": " << ended.err;
  EXPECT_THAT(ended.err, HasSubstr(words));
  const std::size_t at = ended.err.rfind("crosstie: ");
  ASSERT_NE(at, std::string::npos) << ended.err;
  EXPECT_EQ(ended.err.find('\n', at), ended.err.size() - 1) << ended.err;
}

/// The small job in a folder of its own, and the results that it has when nothing disturbs it.
class Surroundings : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    ASSERT_TRUE(make_small_job(*folder_ / "job"));
    fresh_ = new Files(files_in(job()));
    ASSERT_EQ(run_with({"run", job().string()}).exit_code, 0);
    done_ = new Files(files_in(job()));
  }
  static void TearDownTestSuite() {
    delete done_;
    delete fresh_;
    delete folder_;
  }
  static fs::path job() { return *folder_ / "job"; }
  static std::vector<std::string> run_words() { return {"run", job().string()}; }
  static void expect_done(const fs::path& folder = job()) { EXPECT_EQ(differences(*done_, files_in(folder)), ""); }

  static TemporaryFolder* folder_;
  static Files* fresh_;
  static Files* done_;
};
TemporaryFolder* Surroundings::folder_ = nullptr;
Files* Surroundings::fresh_ = nullptr;
Files* Surroundings::done_ = nullptr;

/// Photographs that take half a second of computing each.
std::vector<std::string> long_simulation(const fs::path& out) {
  return {"simulate", "--scene", "cross", "--out", out.string(), "--threads", "2"};
}

TEST_F(Surroundings, CtrlCWorksWithinASecondAndLeavesNothing) {
  for (const auto& [signal, at_s] : {std::pair{SIGINT, 0.03}, {SIGINT, 0.3}, {SIGTERM, 0.15}}) {
    SCOPED_TRACE(fmt::format("signal {} after {} s of computing", signal, at_s));
    const TemporaryFolder folder;
    Running running(long_simulation(folder / "job"));
    while (!running.ended() && running.used_s() < at_s) usleep(2000);
    running.send(signal);
    const Ended ended = running.wait();
    expect_one_line(ended, 130, "");
    EXPECT_LT(ended.seconds, 1.0);
    EXPECT_TRUE(files_in(folder.path()).empty()) << differences({}, files_in(folder.path()));
  }
}

TEST_F(Surroundings, CtrlCKeepsTheEarlierResult) {
  restore(job(), *done_);
  std::string text = read_all(job() / "job.toml");
  text.replace(text.find("[markers]\n"), 10, "[markers]\nexclude_ids = [\"10\"]\n");
  std::ofstream(job() / "job.toml") << text;
  Files before = files_in(job());
  for (const double at_s : {0.03, 0.08, 0.13}) {
    restore(job(), before);
    Running running(run_words());
    while (!running.ended() && running.used_s() < at_s) usleep(1000);
    running.send(SIGINT);
    const Ended ended = running.wait();
    EXPECT_THAT(ended.exit_code, testing::AnyOf(130, 0)) << ended.err;
    EXPECT_LT(ended.seconds, 1.0);
    for (const auto& [name, contents] : files_in(job())) EXPECT_TRUE(before.contains(name)) << "left behind: " << name;
  }
}

TEST_F(Surroundings, TwoRunsInOneFolder) {
  for (int turn = 0; turn < 3; ++turn) {
    restore(job(), *fresh_);
    Running first(run_words());
    usleep(static_cast<useconds_t>(20'000 * turn));
    Running second(run_words());
    int done = 0;
    for (Running* one : {&first, &second}) {
      const Ended ended = one->wait();
      if (ended.exit_code == 0)
        ++done;
      else
        expect_one_line(ended, 5, "another crosstie holds");
    }
    EXPECT_GE(done, 1);
    expect_done();
  }
}

TEST_F(Surroundings, AResultIsCurrentByItsContentsNotByTheClock) {
  const auto jump = [](long by_s) {
    return Fault{{{"LD_PRELOAD", CROSSTIE_FAILING_CALLS},
                  {"ASAN_OPTIONS", "verify_asan_link_order=0"},
                  {"CROSSTIE_FAULT_CLOCK", std::to_string(by_s)}},
                 {}};
  };
  const long ten_years = 10L * 365 * 86400;
  for (const long by_s : {-ten_years, ten_years}) {
    SCOPED_TRACE(by_s);
    restore(job(), *done_);
    const Ended ended = run_with(run_words(), jump(by_s));
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr("up to date"));
    expect_done();
    // Computed anew under that clock: the same bytes.
    restore(job(), *fresh_);
    EXPECT_EQ(run_with(run_words(), jump(by_s)).exit_code, 0);
    expect_done();
  }
  // Files of the future and of long ago are the same files; others with the old time are others.
  restore(job(), *done_);
  const fs::path photograph = job() / "net" / fs::path(*fs::directory_iterator(job() / "net")).filename();
  for (const int hours : {-100'000, 100'000}) {
    for (const auto& entry : fs::recursive_directory_iterator(job())) {
      if (entry.is_regular_file()) fs::last_write_time(entry, fs::file_time_type::clock::now() + std::chrono::hours(hours));
    }
    EXPECT_THAT(run_with(run_words()).err, testing::Not(HasSubstr("coded markers\n")));
    expect_done();
  }
  const auto time = fs::last_write_time(photograph);
  const std::string other = photograph.string().ends_with("001.png") ? "hand_002.png" : "hand_001.png";
  fs::copy_file(job() / "net" / other, photograph, fs::copy_options::overwrite_existing);
  fs::last_write_time(photograph, time);
  EXPECT_THAT(run_with(run_words()).err, HasSubstr("coded markers"));
}

TEST_F(Surroundings, ADecimalCommaChangesNoByte) {
  const TemporaryFolder locales;
  const std::string made = "localedef -i de_DE -f UTF-8 '" + (locales / "de_DE.UTF-8").string() + "' >/dev/null 2>&1";
  if (std::system(made.c_str()) != 0) GTEST_SKIP() << "localedef cannot make de_DE.UTF-8";
  restore(job(), *fresh_);
  const Fault comma{{{"LOCPATH", locales.path().string()}, {"LC_ALL", "de_DE.UTF-8"}, {"LANG", "de_DE.UTF-8"}}};
  const Ended ended = run_with(run_words(), comma);
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  expect_done();
}

TEST_F(Surroundings, LittleMemoryIsEnoughOrTold) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "sanitizers reserve far more than they use";
#endif
  int told = 0;
  for (rlim_t mib = 125; mib <= 205; mib += 10) {
    SCOPED_TRACE(fmt::format("{} MiB of address space", mib));
    restore(job(), *fresh_);
    const Ended ended = run_with(run_words(), {{}, {{RLIMIT_AS, mib << 20}}});
    if (ended.exit_code != 0 && run_with({"--version"}, {{}, {{RLIMIT_AS, mib << 20}}}).exit_code != 0)
      continue;  // no room for its libraries
    if (ended.exit_code == 0) {
      expect_done();
      continue;
    }
    ++told;
    EXPECT_EQ(ended.signal, 0) << ended.err;
    expect_one_line(ended, 5, "");
    EXPECT_TRUE(ended.err.find("memory") != std::string::npos || ended.err.find("refuses") != std::string::npos) << ended.err;
    for (const auto& [name, contents] : files_in(job())) EXPECT_TRUE(done_->contains(name)) << "left behind: " << name;
  }
  EXPECT_GT(told, 0) << "none of these limits was felt";
}

TEST_F(Surroundings, AComputerThatGivesNoThreads) {
  for (const int first : {1, 2, 3}) {
    SCOPED_TRACE(first);
    restore(job(), *fresh_);
    auto words = run_words();
    words.insert(words.end(), {"--threads", "8"});
    const Ended ended = run_with(words, {{{"LD_PRELOAD", CROSSTIE_FAILING_CALLS},
                                          {"ASAN_OPTIONS", "verify_asan_link_order=0"},
                                          {"CROSSTIE_FAULT_THREAD", std::to_string(first)}},
                                         {}});
    if (first == 1) {
      expect_one_line(ended, 5, "the system refuses");  // not even the one that hears Ctrl-C
      continue;
    }
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    expect_done();
  }
}

TEST_F(Surroundings, OddAndLongNamesOfFolders) {
  const std::string longest(150, 'n');
  const std::string names[] = {"with blank", "\xC3\xBC\xC3\x9F \xE4\xBD\xA0\xE5\xA5\xBD", "new\nline", "it's {0} %s",
                               "[ab]*?",     longest + "/" + longest + "/" + longest,     "-dash",     "\xFF not utf-8"};
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    const TemporaryFolder folder;
    const fs::path there = folder / name / "job";
    fs::create_directories(there);
    restore(there, *fresh_);
    const Ended ended = run_with({"run", there.string()});
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    expect_done(there);
    EXPECT_THAT(run_with({"run", there.string()}).err, testing::Not(HasSubstr("coded markers\n")));
    // As it is called from within: relative names, and files of the whole length that names may have.
    const std::string longest_file = std::string(251, 'x') + ".csv";
    const Ended within = run_with({"convert", "reference/tritop.csv", longest_file}, {{}, {}, there});
    EXPECT_EQ(within.exit_code, 0) << within.err;
    EXPECT_TRUE(fs::exists(there / longest_file));
  }
}

TEST_F(Surroundings, AJobThatIsUpToDateMayLieWhereNobodyWrites) {
  restore(job(), *done_);
  const auto read_only = [](const std::string& call) { return at_call("from:1:" + std::to_string(EROFS) + call, job()); };
  const Ended current = run_with(run_words(), read_only(""));
  EXPECT_EQ(current.exit_code, 0) << current.err;
  expect_done();
  restore(job(), *fresh_);
  expect_one_line(run_with(run_words(), read_only("")), 5, "Read-only file system");
  EXPECT_EQ(differences(*fresh_, files_in(job())), "");
}

TEST_F(Surroundings, AFullFileSystem) {
  // A file system of its own in a name space of its own, where this user may make one.
  if (std::system("unshare -rm true 2>/dev/null") != 0)
    GTEST_SKIP() << "no name space of its own to mount a small file system in";
  for (const int kib : {64, 300, 600}) {
    SCOPED_TRACE(kib);
    const TemporaryFolder folder;
    fs::create_directory(folder / "out");
    const std::string command = fmt::format(
        "unshare -rm sh -c 'mount -t tmpfs -o size={}k small \"$2\" && \"$1\" run \"$3\" --out \"$2/results\" 2>\"$4\"; "
        "echo $? >>\"$4\"; find \"$2\" -name \".*\" >>\"$4\"' sh '{}' '{}' '{}' '{}' >/dev/null",
        kib, CROSSTIE_EXECUTABLE, (folder / "out").string(), job().string(), (folder / "said").string());
    restore(job(), *fresh_);
    ASSERT_EQ(std::system(command.c_str()), 0);
    const std::string said = read_all(folder / "said");
    EXPECT_THAT(said, HasSubstr("No space left on device\n5\n"));
    EXPECT_TRUE(said.ends_with("\n5\n")) << "left behind: " << said;
  }
}

TEST_F(Surroundings, IdsWithLeadingZerosAreTheSameIds) {
  const TemporaryFolder folder;
  folder.write("a.csv", "id,x_mm,y_mm,z_mm\n7,0,0,0\n12,500,0,0\n13,0,400,0\n104,10,20,300\n");
  folder.write("b.csv", "id,x_mm,y_mm,z_mm\n007,0,0,0\n012,500,0,0\n0013,0,400,0\n0104,10,20,300\n");
  const Ended ended = run_with({"verify", "--points", (folder / "a.csv").string(), "--reference", (folder / "b.csv").string(),
                                "--out", (folder / "out").string()});
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.err, HasSubstr("4 points"));
}

TEST_F(Surroundings, SimulateLeavesFoldersWithFilesAlone) {
  const TemporaryFolder folder;
  folder.write("mine/result.json", "mine");
  expect_one_line(run_with({"simulate", "--scene", "cross", "--out", (folder / "mine").string()}), 2, "holds files");
  EXPECT_EQ(read_all(folder / "mine/result.json"), "mine");
}

struct Version {
  const char* name;
  const char* file;  ///< of the done job
  const char* from;
  const char* to;
  std::vector<std::string> words;  ///< JOB stands for the job
  int exit_code;
  const char* said;
};

class Versions : public Surroundings, public testing::WithParamInterface<Version> {};

TEST_P(Versions, AreToldOrComputedAgain) {
  const Version& version = GetParam();
  restore(job(), *done_);
  std::string text = read_all(job() / version.file);
  const std::size_t at = text.find(version.from);
  ASSERT_NE(at, std::string::npos) << text.substr(0, 400);
  std::ofstream(job() / version.file) << text.replace(at, std::string(version.from).size(), version.to);
  auto words = version.words;
  for (std::string& word : words) {
    if (word.starts_with("JOB")) word = job().string() + word.substr(3);
  }
  const Ended ended = run_with(words);
  if (version.exit_code == 0) {
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr(version.said));
    expect_done();
  } else {
    expect_one_line(ended, version.exit_code, version.said);
    EXPECT_THAT(ended.err, HasSubstr(fs::path(version.file).filename().string())) << "names the file";
  }
}

const std::vector<std::string> kRun = {"run", "JOB"};
const std::vector<std::string> kConvert = {"convert", "JOB/results/adjust", "JOB/out.csv"};

INSTANTIATE_TEST_SUITE_P(
    Program, Versions,
    testing::Values(Version{"job_of_a_newer_format", "job.toml", "crosstie-job/1", "crosstie-job/2", kRun, 3, "crosstie-job/1"},
                    Version{"job_of_an_older_format", "job.toml", "crosstie-job/1", "crosstie-job/0", kRun, 3,
                            "crosstie-job/1"},
                    Version{"job_without_a_format", "job.toml", "format = \"crosstie-job/1\"\n", "", kRun, 3, "format"},
                    Version{"newer_result_is_computed_again", "results/adjust/result.json", "crosstie-result/1",
                            "crosstie-result/2", kRun, 0, "points from"},
                    Version{"result_of_an_older_program_is_computed_again", "results/adjust/result.json", "\"version\": \"",
                            "\"version\": \"0.0.", kRun, 0, "points from"},
                    Version{"newer_detection_is_computed_again", "results/detect/result.json", "crosstie-result/1",
                            "crosstie-result/2", kRun, 0, "coded markers"},
                    Version{"newer_result_is_not_read", "results/adjust/result.json", "crosstie-result/1", "crosstie-result/2",
                            kConvert, 3, "crosstie-result/1"},
                    Version{"older_result_is_not_read", "results/adjust/result.json", "crosstie-result/1", "crosstie-result/0",
                            kConvert, 3, "crosstie-result/1"}),
    [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace crosstie::tests
