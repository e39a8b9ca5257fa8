// crosstie adjust: observations of a network -> coordinates with sigmas

#include <fmt/core.h>

#include "app/job_index.h"
#include "app/job_steps.h"
#include "app/verb.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

using base::Result;

/// Reports a finished adjustment.
Outcome said(const StepOutcome& step, Session& session) {
  session.say("adjust  " + step.summary);
  session.print((step.folder / "result.json").string());
  return step.outcome;
}

Result<AiconTask> aicon_task(const Arguments& arguments) {
  AiconTask task;
  task.folder = *arguments.get("--aicon");
  for (const auto& [name, value] :
       {std::pair{"--sigma-mm", &task.reading.sigma_mm}, std::pair{"--sigma-px", &task.reading.sigma_px}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    if (!*number) continue;
    if (!(**number > 0.0)) return base::fail(base::ErrorCode::kUsage, std::string(name) + " must be positive");
    *value = **number;
  }
  if (arguments.has("--sigma-mm") && arguments.has("--sigma-px")) {
    return base::fail(base::ErrorCode::kUsage, "--sigma-mm and --sigma-px exclude each other");
  }
  if (const auto file = arguments.get("--sigma-override")) task.sigmas = *file;
  if (const auto file = arguments.get("--exclude")) task.excluded = *file;
  if (const auto fixed = arguments.get("--fixed")) {
    task.held.clear();
    for (const std::string_view name : base::split(*fixed, ',')) {
      if (!base::trim(name).empty()) task.held.emplace_back(base::trim(name));
    }
  }
  task.reject_outliers = arguments.has("--reject-outliers");
  task.apply_components = arguments.has("--apply-variance-components");
  task.reading.start_values = !arguments.has("--no-start-values");
  return task;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto out = arguments.get("--out");
  if (arguments.has("JOB") == arguments.has("--aicon")) {
    return base::fail(base::ErrorCode::kUsage, "adjust takes a JOB, or --aicon with a project's folder");
  }
  if (arguments.has("--aicon")) {
    if (!out) return base::fail(base::ErrorCode::kUsage, "--aicon needs --out, a folder for the result");
    const auto task = aicon_task(arguments);
    if (!task) return tl::unexpected(task.error());
    const auto adjustment = adjust_aicon_step(*task, *out, session);
    if (!adjustment) return tl::unexpected(adjustment.error());
    return said(*adjustment, session);
  }
  for (const char* option : {"--sigma-mm", "--sigma-px", "--sigma-override", "--exclude", "--fixed", "--reject-outliers",
                             "--apply-variance-components", "--no-start-values"}) {
    if (arguments.has(option))
      return base::fail(base::ErrorCode::kUsage, std::string(option) + " goes with --aicon; a job says it in its job.toml");
  }
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto results = job->folder / "results";
  const auto tell = [&](const JobStep& step, const StepOutcome& done) {
    session.say(fmt::format("{:<8}{}", step.name, done.summary));
  };
  if (auto done = prepare("adjust", {*job, results, session}, tell); !done) return base::fail(std::move(done));
  const auto adjustment =
      adjust_step(*job, results / "detect", out ? std::filesystem::path(*out) : results / "adjust", session);
  if (!adjustment) return tl::unexpected(adjustment.error());
  return with_index(*job, said(*adjustment, session));  // also with --out: what it needed stands in the job
}

}  // namespace

Verb adjust_verb() {
  return {
      "adjust",
      "bundle-adjust a network of photographs: coordinates, poses and lenses with full covariance",
      "  $ crosstie adjust cross\n"
      "  detect  24 images, up to date\n"
      "  adjust  57 points (9 uncoded) from 24 images, sigma0 0.0025 px, redundancy 1974, 12 rejected, 2 warnings\n"
      "  cross/results/adjust/result.json",
      {{"JOB", "JOB", "job folder or its job.toml", false, false},
       {"--out", "DIR", "folder for the result (default: JOB/results/adjust); replaced as a whole", false, false},
       {"--aicon", "DIR", "instead of a job: the folder of an AICON project (.phc .obc .ior .eor .scale), adjusted as it is",
        false, false},
       {"--sigma-mm", "MM", "with --aicon: a priori sigma of image coordinates on the sensor (default 0.0005)", false, false},
       {"--sigma-px", "PX", "with --aicon: the same in pixels", false, false},
       {"--sigma-override", "FILE", "with --aicon: image points with a sigma of their own; columns image,id,sigma_mm", false,
        false},
       {"--exclude", "FILE", "with --aicon: image points that do not take part; columns image,id", false, false},
       {"--fixed", "NAMES", "with --aicon: lens parameters held at their values (default A3,C1,C2)", false, false},
       {"--reject-outliers", "", "with --aicon: reject outliers (default: everything takes part)", false, false},
       {"--apply-variance-components", "",
        "with --aicon: multiply the sigmas of each group of observations by what their residuals tell (default: tell it)",
        false, false},
       {"--no-start-values", "", "with --aicon: find poses and points from the image points alone", false, false}},
      run};
}

}  // namespace crosstie::app
