// The honesty study: the whole chain on the digital twin, one line of JSON for each seed in a file that grows.
//
//     study LINES.jsonl FIRST LAST [THREADS]      does the seeds that the file does not have
//     study --compare SEED JOB                    the line of a job that lies there (simulate --scene study --vary --seed SEED, run)
//     study --sampled FIRST LAST                  the machine's frame alone, from image points that are drawn
//     study --summarise LINES.jsonl DOCS          tables and plots into DOCS/accuracy.md and DOCS/pictures

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "fixtures/simulate.h"
#include "fixtures/varied.h"
#include "tests/study/comparison.h"
#include "tests/study/sampled.h"
#include "tests/study/summary.h"
#include "tests/support/program.h"

namespace crosstie::study {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

double cpu_s() {
  double sum = 0.0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    getrusage(who, &used);
    for (const timeval& part : {used.ru_utime, used.ru_stime})
      sum += static_cast<double>(part.tv_sec) + 1e-6 * static_cast<double>(part.tv_usec);
  }
  return sum;
}

/// The lens model is given: to choose one by cross-validation costs more than all the rest together.
void simplify(const fs::path& job) {
  std::string text = tests::read_all(job / "job.toml");
  for (const char* table : {"[camera.left]\n", "[camera.right]\n"})
    text.insert(text.find(table) + std::string(table).size(), "lens = \"opencv5\"\n");
  const std::string board = "[board]\n";
  text.insert(text.find(board) + board.size(), "detector = \"classic\"\n");
  std::ofstream(job / "job.toml", std::ios::binary) << text;
}

ordered_json run_seed(std::uint64_t seed, int threads) {
  const auto begun = std::chrono::steady_clock::now();
  const double cpu_before_s = cpu_s();
  ordered_json line = {{"seed", seed}};
  const tests::TemporaryFolder folder;
  const fs::path job = folder / "job";
  const fixtures::Scene world = fixtures::varied(*fixtures::make_scene("study"), seed);
  if (const auto done = fixtures::simulate(world, job, {.seed = seed, .threads = threads}); !done) {
    line["error"] = done.error().message;
    return line;
  }
  simplify(job);
  line["simulate_cpu_s"] = std::round(10.0 * (cpu_s() - cpu_before_s)) / 10.0;
  const tests::ProgramRun run = tests::run_program({"run", job.string(), "--threads", std::to_string(threads)});
  if (run.exit_code > 1) {
    line["error"] = run.err;
    return line;
  }
  auto compared = compare(fixtures::drawn(world, seed), job);
  if (!compared) {
    line["error"] = compared.error().message;
    return line;
  }
  line.update(*compared);
  line["cpu_s"] = std::round(10.0 * (cpu_s() - cpu_before_s)) / 10.0;
  line["wall_s"] = std::round(std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
  return line;
}

int run(const fs::path& file, std::uint64_t first, std::uint64_t last, int threads) {
  std::set<std::uint64_t> done;
  std::string whole;  // without a line that an end in the middle left half
  std::ifstream before(file);
  for (std::string text; std::getline(before, text);) {
    const auto line = ordered_json::parse(text, nullptr, false);
    if (line.is_discarded()) continue;
    done.insert(line.at("seed").get<std::uint64_t>());
    whole += text + "\n";
  }
  std::ofstream(file, std::ios::binary) << whole;
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    if (done.contains(seed)) continue;
    const ordered_json line = run_seed(seed, threads);
    std::ofstream(file, std::ios::app | std::ios::binary) << line.dump() << std::endl;
    fmt::print("seed {}: {}\n", seed,
               line.contains("error")
                   ? line["error"].get<std::string>()
                   : fmt::format("{} s, {} s of CPU", line["wall_s"].get<double>(), line["cpu_s"].get<double>()));
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace crosstie::study

int main(int count, char** words) {
  const std::vector<std::string> arguments(words + 1, words + count);
  if (arguments.size() == 3 && arguments[0] == "--summarise") return crosstie::study::summarise(arguments[1], arguments[2]);
  if (arguments.size() == 3 && arguments[0] == "--sampled")
    return crosstie::study::sampled_frames(std::stoull(arguments[1]), std::stoull(arguments[2]));
  if (arguments.size() == 3 && arguments[0] == "--compare") {
    const std::uint64_t seed = std::stoull(arguments[1]);
    const auto scene = crosstie::fixtures::make_scene("study");
    const auto line =
        crosstie::study::compare(crosstie::fixtures::drawn(crosstie::fixtures::varied(*scene, seed), seed), arguments[2]);
    fmt::print("{}\n", line ? line->dump() : line.error().message);
    return line ? 0 : 1;
  }
  if (arguments.size() < 3) {
    fmt::print(stderr, "usage: study LINES.jsonl FIRST LAST [THREADS] | study --summarise LINES.jsonl DOCS\n");
    return 2;
  }
  return crosstie::study::run(arguments[0], std::stoull(arguments[1]), std::stoull(arguments[2]),
                              arguments.size() > 3 ? std::stoi(arguments[3]) : 1);
}
