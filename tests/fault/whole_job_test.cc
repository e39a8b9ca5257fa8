// The soak: a whole job with all of its steps (CROSSTIE_FAULT_JOB, a job folder that is copied), killed or interrupted at random times, over and
// over (CROSSTIE_FAULT_KILLS times, 200 without it), while the job changes back and forth.
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>

#include <unistd.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/fault/faulty_program.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;

/// The results that a job has, one by one: the step's folder, or those of its stations; and the overview.
std::vector<std::string> results_of(const Files& files) {
  std::vector<std::string> results;
  for (const auto& [name, contents] : files) {
    if (name.ends_with("/result.json")) results.push_back(name.substr(0, name.size() - 12));
  }
  results.emplace_back("index.html");
  return results;
}

/// The job with a marker left out: everything from the detection on is another result. The calibration of the source stays, since it takes long.
std::string other_job(std::string text, const std::string& id) {
  return text.insert(text.find("[markers]\n") + 10, "exclude_ids = [\"" + id + "\"]\n");
}

TEST(WholeJob, KilledAtRandomTimesIsOldOrNewAndResumes) {
  const char* source = std::getenv("CROSSTIE_FAULT_JOB");
  if (source == nullptr) GTEST_SKIP() << "no job in CROSSTIE_FAULT_JOB";
  const char* number = std::getenv("CROSSTIE_FAULT_KILLS");
  const int kills = number == nullptr ? 200 : std::atoi(number);
  const TemporaryFolder folder;
  const fs::path job = folder / "job";
  fs::copy(source, job, fs::copy_options::recursive);
  fs::remove_all(job / "results");
  std::string text = read_all(job / "job.toml");
  if (const std::size_t at = text.find("\nexclude_ids"); at != std::string::npos)
    text.erase(at + 1, text.find('\n', at + 1) - at);
  const std::string texts[] = {other_job(text, "0"), other_job(text, "1")};
  const auto set = [&](int which) { std::ofstream(job / "job.toml") << texts[which]; };
  const auto words = [&](const fs::path& results) {
    return std::vector<std::string>{"run", job.string(), "--out", results.string(), "--quiet"};
  };

  const Fault patient{.longest_s = 3600};
  const fs::path results = folder / "results";
  fs::create_directory(results);
  if (fs::exists(fs::path(source) / "results/calibrate"))
    fs::copy(fs::path(source) / "results/calibrate", results / "calibrate", fs::copy_options::recursive);
  double whole_s = 0.0;
  Files golden[2];
  for (const int which : {0, 1}) {
    set(which);
    const Ended ended = run_with(words(results), patient);
    ASSERT_LE(ended.exit_code, 1) << ended.err;
    ASSERT_GE(ended.exit_code, 0) << ended.signal << ended.err;
    golden[which] = files_in(results);
    whole_s = ended.used_s;
  }
  for (const std::string& one : results_of(golden[0])) {
    const bool differs = part_of(golden[0], one) != part_of(golden[1], one);
    EXPECT_TRUE(differs || one == "calibrate") << one << " is the same in both, and shows no mix";
  }

  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  int which = 0;
  set(which);
  int done = 0;
  int completed = 0;
  double slowest_s = 0.0;
  while (done < kills) {
    Running running(words(results), patient);
    const double at_s =
        whole_s * std::pow(uniform(random), 3.0);  // of computing: most come soon, some let the longest step pass
    while (!running.ended() && running.used_s() < at_s) usleep(1000);
    const bool interrupt = done % 4 == 3;
    if (!running.ended()) {
      running.send(interrupt ? SIGINT : SIGKILL);
      ++done;
    }
    const Ended ended = running.wait();
    const Files now = files_in(results);
    for (const std::string& one : results_of(golden[0])) {
      const Files part = part_of(now, one);
      if (one == "index.html") {  // after Ctrl-C it tells what was done until then
        EXPECT_TRUE(part.empty() || part.at(one).find("</html>") != std::string::npos) << "kill " << done;
        continue;
      }
      EXPECT_TRUE(part == part_of(golden[0], one) || part == part_of(golden[1], one))
          << "kill " << done << ": " << one << ": " << differences(part_of(golden[which], one), part);
    }
    if (ended.signal == 0 && interrupt && ended.exit_code == 130) slowest_s = std::max(slowest_s, ended.seconds);
    if (ended.signal == 0 && ended.exit_code <= 1) {
      EXPECT_EQ(differences(golden[which], now), "") << "after kill " << done;
      ++completed;
      which = 1 - which;
      set(which);
    } else if (ended.signal == 0) {
      EXPECT_EQ(ended.exit_code, 130) << ended.err;
    }
    if (done % 20 == 0) std::cout << fmt::format("{} kills, {} runs completed\n", done, completed) << std::flush;
  }
  set(which);
  EXPECT_LE(run_with(words(results), patient).exit_code, 1);
  EXPECT_EQ(differences(golden[which], files_in(results)), "");
  EXPECT_LT(slowest_s, 1.0) << "Ctrl-C";
  std::cout << fmt::format("{} kills, {} runs completed between them, Ctrl-C at most {:.2f} s\n", done, completed + 1,
                           slowest_s);
}

}  // namespace
}  // namespace crosstie::tests
