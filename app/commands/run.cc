// crosstie run: a job folder, step by step, only what is out of date

#include <algorithm>

#include <fmt/core.h>

#include "app/job_graph.h"
#include "app/job_index.h"
#include "app/job_steps.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

/// The steps that are to be done: all that the job asks for, or those up to one.
Result<std::vector<const JobStep*>> chosen_steps(const Job& job, const Arguments& arguments) {
  if (const auto last = arguments.get("--to")) return steps_until(job, *last);
  std::vector<const JobStep*> steps = steps_of(job);
  if (steps.empty()) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: the job asks for nothing: it has no [board] with cameras to calibrate, no [network] of "
                                  "photographs, no [cross] that a head sees and no [[station]] with a scan",
                                  job.file.string()));
  }
  return steps;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto steps = chosen_steps(*job, arguments);
  if (!steps) return tl::unexpected(steps.error());
  if (arguments.has("--print-graph")) {
    const auto graph = snakefile(*job, *steps);
    if (!graph) return tl::unexpected(graph.error());
    session.print(*graph);
    return Outcome::kOk;
  }
  std::size_t width = 0;
  for (const JobStep* step : *steps) width = std::max(width, step->name.size());
  Outcome outcome = Outcome::kOk;
  const auto tell = [&](const JobStep& step, const StepOutcome& done) {
    const bool failed = done.outcome == Outcome::kVerdictFailed;
    session.say(fmt::format("{:<{}}  {}{}", step.name, width, done.summary, failed ? "  (a verdict FAILs)" : ""));
    std::error_code ignored;  // the scans' reports stand in a folder of each station and were told already
    if (std::filesystem::exists(done.folder / "report.html", ignored)) session.print((done.folder / "report.html").string());
    if (failed) outcome = Outcome::kVerdictFailed;
  };
  const auto out = arguments.get("--out");
  const StepRun at{*job, out ? std::filesystem::path(*out) : job->folder / "results", session};
  auto done = do_steps(*steps, at, tell);
  auto index = write_job_index(*job, at.results);  // also of what was done before a step that failed
  if (!done) return base::fail(std::move(done));
  if (!index) return base::fail(std::move(index));
  session.print((at.results / "index.html").string());
  return outcome;
}

std::vector<std::string> step_names() {
  std::vector<std::string> names;
  for (const JobStep& step : job_steps()) names.emplace_back(step.name);
  return names;
}

}  // namespace

Verb run_verb() {
  return {"run",
          "do all that a job asks for, recomputing only what changed",
          "  $ crosstie run cross\n"
          "  detect  24 images, 1042 coded markers\n"
          "  adjust  57 points (9 uncoded) from 24 images, sigma0 0.0025 px, redundancy 1974, 12 rejected, 2 warnings\n"
          "  verify  44 points, RMS 0.0084 0.0071 0.0085 mm (x y z), deviation over predicted sigma 0.93; 0 of 9 uncoded have "
          "a partner\n"
          "  cross/results/index.html",
          {{"JOB", "JOB", "job folder or its job.toml", true, false},
           {"--to", "STEP", "only this step, such as adjust or commission, and what it needs (default: all of them)", false,
            false, 1, step_names()},
           {"--out", "DIR", "folder for the results of all steps, DIR/<step>/ (default: JOB/results)", false, false},
           {"--print-graph", "", "instead: print the steps with their files as a Snakefile, to be run in the job folder", false,
            false}},
          run};
}

}  // namespace crosstie::app
