// crosstie stitch: all stations in one frame, one cloud

#include <algorithm>

#include <fmt/core.h>

#include "app/job_index.h"
#include "app/steps_stitch.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

template <typename Task>
Result<> set_options(const Arguments& arguments, Session& session, Task& task) {
  const auto number = [&](const char* name, double& value) -> Result<> {
    const auto given = arguments.number(name);
    if (!given) return tl::unexpected(given.error());
    if (*given) value = **given;
    return {};
  };
  const auto optional = [&](const char* name, std::optional<double>& value) -> Result<> {
    const auto given = arguments.number(name);
    if (!given) return tl::unexpected(given.error());
    if (*given) value = **given;
    return {};
  };
  if (auto set = number("--cell-mm", task.merge.cell_mm); !set) return set;
  if (auto set = number("--piece-mm", task.surface.cell_mm); !set) return set;
  if (auto set = optional("--sigma-mm", task.surface.sigma_mm); !set) return set;
  if (auto set = optional("--reach-mm", task.stitch.start_reach_mm); !set) return set;
  const auto rounds = arguments.integer("--max-icp-rounds");
  if (!rounds) return tl::unexpected(rounds.error());
  if (*rounds) task.stitch.max_iterations = static_cast<int>(std::clamp<long>(**rounds, 0, 10000));
  task.merge.sigma_mm = task.surface.sigma_mm;
  task.stitch.threads = session.threads();
  if (auto valid = task.surface.validate(); !valid) return valid;
  if (auto valid = task.stitch.validate(); !valid) return valid;
  return task.merge.validate();
}

Result<Outcome> finish(const Result<StepOutcome>& step, Session& session) {
  if (!step) return tl::unexpected(step.error());
  session.say(fmt::format("{:<11}{}", "stitch", step->summary));
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto out = arguments.get("--out");
  if (arguments.has("--surface-only")) {
    if (arguments.has("JOB") || arguments.has("--markers")) {
      return fail(ErrorCode::kUsage, "--surface-only goes neither with a JOB nor with --markers");
    }
    if (!out) return fail(ErrorCode::kUsage, "--surface-only needs --out, the folder for the result");
    SurfaceStitchTask task;
    for (const std::string& path : arguments.all("--surface-only")) task.clouds.emplace_back(path);
    task.title = "surfaces alone";
    if (auto set = set_options(arguments, session, task); !set) return fail(std::move(set));
    return finish(surface_stitch_step(task, *out, session), session);
  }
  const auto folder = arguments.get("JOB");
  if (!folder) return fail(ErrorCode::kUsage, "stitch needs a JOB, or --surface-only A.ply B.ply --out DIR");
  const auto job = read_job(*folder);
  if (!job) return tl::unexpected(job.error());
  const auto results = job->folder / "results";
  auto task = stitch_task(*job, results);
  if (!task) return fail(std::move(task));
  if (auto set = set_options(arguments, session, *task); !set) return fail(std::move(set));
  if (const auto markers = arguments.get("--markers")) {
    task->reference = *markers;
    task->reference_in_part = false;
  }
  if (const auto frame = arguments.get("--markers-frame")) {
    if (*frame != "machine" && *frame != "part") return fail(ErrorCode::kUsage, "--markers-frame is machine or part");
    if (!task->reference) return fail(ErrorCode::kUsage, "--markers-frame goes with --markers");
    task->reference_in_part = *frame == "part";
  }
  if (out) return finish(stitch_step(*task, *out, session), session);
  return with_index(*job, finish(stitch_step(*task, results / "stitch", session), session));
}

}  // namespace

Verb stitch_verb() {
  return {
      "stitch",
      "bring the scans of all stations into one frame by markers, axis and surfaces (ICP inside of one adjustment): one cloud",
      "  $ crosstie stitch door\n"
      "  stitch     3 stations, 2 overlaps, 14 markers (0 left out), 3 rounds of ICP, least known axial 0.012 mm, 311520 "
      "points\n"
      "  door/results/stitch/result.json\n",
      {{"JOB", "JOB", "job folder or its job.toml, after scan", false, false},
       {"--surface-only", "A.ply B.ply",
        "instead: two clouds of a part whose surface alone determines the motion between them; others are refused", false,
        false, 2},
       {"--markers", "FILE",
        "coordinates of the markers round the hole with sigmas, as somebody measured them (default: [hole] markers of the job)",
        false, false},
       {"--markers-frame",
        "FRAME",
        "of those coordinates: machine, or part where they have a frame of their own (default machine)",
        false,
        false,
        1,
        {"machine", "part"}},
       {"--out", "DIR", "folder for the result (default: JOB/results/stitch)", false, false},
       {"--cell-mm", "MM", "edge of the cells in which points become one (default 2)", false, false},
       {"--piece-mm", "MM",
        "edge of the pieces of surface that are matched (default: 16 points each, at most 20000 pieces a station)", false,
        false},
       {"--sigma-mm", "MM", "sigma of a point along the normal (default: as the clouds say, or as they scatter)", false, false},
       {"--reach-mm", "MM",
        "how far partners are sought in the first round (default: 0.8 pieces; with --surface-only 5 % of the size)", false,
        false},
       {"--max-icp-rounds", "N", "rounds of matching (ICP) after which pairs are held (default 20)", false, false}},
      run};
}

}  // namespace crosstie::app
