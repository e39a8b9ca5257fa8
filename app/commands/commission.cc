// crosstie commission: the head in the machine's frame, and whether it still holds

#include <fmt/core.h>

#include "app/job_index.h"
#include "app/job_steps.h"
#include "app/steps_commission.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

Result<Outcome> check(const Job& job, const Arguments& arguments, const std::filesystem::path& results, Session& session) {
  const auto axis_mm = arguments.number("--axis-mm");
  if (!axis_mm) return tl::unexpected(axis_mm.error());
  if (!*axis_mm) return base::fail(ErrorCode::kUsage, "--check needs --axis-mm, the axis's reading where the pair was taken");
  const auto temperature_c = arguments.number("--temperature-c");
  if (!temperature_c) return tl::unexpected(temperature_c.error());
  const std::vector<std::string> pair = arguments.all("--check");
  if (pair.size() != 2) return base::fail(ErrorCode::kUsage, "--check takes two images: LEFT RIGHT");
  HeadCheckTask task{
      .left = pair[0], .right = pair[1], .axis_mm = **axis_mm, .probed_again = {}, .temperature_c = *temperature_c};
  if (const auto file = arguments.get("--probed-again")) task.probed_again = *file;
  const auto out = arguments.get("--out");
  const auto checked =
      check_head_step(job, task, results / "commission", out ? std::filesystem::path(*out) : results / "check", session);
  if (!checked) return tl::unexpected(checked.error());
  for (const std::string& line : checked->lines) session.print(line);
  session.say((checked->step.folder / "report.html").string());
  return checked->step.outcome;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto results = job->folder / "results";
  if (arguments.has("--check")) return check(*job, arguments, results, session);
  for (const char* option : {"--axis-mm", "--temperature-c", "--probed-again"}) {
    if (arguments.has(option)) return base::fail(ErrorCode::kUsage, std::string(option) + " goes with --check");
  }
  if (auto complete = check_commission(*job); !complete) return base::fail(std::move(complete));
  const auto tell = [&](std::string_view name, const StepOutcome& step) {
    session.say(fmt::format("{:<11}{}", name, step.summary));
  };
  const auto of_step = [&](const JobStep& step, const StepOutcome& done) { tell(step.name, done); };
  if (auto done = prepare("commission", {*job, results, session}, of_step); !done) return base::fail(std::move(done));
  const CommissionSources sources{results / "calibrate", results / "adjust", results / "detect-stations"};
  const auto out = arguments.get("--out");
  const auto step = commission_step(*job, sources, out ? std::filesystem::path(*out) : results / "commission", session);
  if (!step) return tl::unexpected(step.error());
  tell("commission", *step);
  session.print((step->folder / "result.json").string());
  return with_index(*job, step->outcome);  // also with --out: what it needed stands in the job
}

}  // namespace

Verb commission_verb() {
  return {"commission",
          "tie the scanning head to the machine's frame: rig, axis, error motions; check whether it still holds",
          "  $ crosstie commission machine\n"
          "  stations   10 images, 349 coded markers\n"
          "  commission 5 stations from 0.0068 to 999.994 mm, direction +- 0.013 mrad, scale 98 +- 14 ppm, EYX EZX EBX, FRE "
          "0.008 mm, sigma0 0.0023 px, 0 rejected, 2 warnings\n"
          "  machine/results/commission/result.json",
          {{"JOB", "JOB", "job folder or its job.toml", true, false},
           {"--out", "DIR", "folder for the result (default: JOB/results/commission, with --check JOB/results/check)", false,
            false},
           {"--check", "LEFT RIGHT", "instead: does the commissioning still hold? One new pair of images of the cross", false,
            false, 2},
           {"--axis-mm", "MM", "with --check: reading of the X axis where the pair was taken", false, false},
           {"--probed-again", "FILE", "with --check: centres of the cross's spheres, probed now; tells the head from the cross",
            false, false},
           {"--temperature-c", "C", "with --check: temperature of the head now, degrees C", false, false}},
          run};
}

}  // namespace crosstie::app
