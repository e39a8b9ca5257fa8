// crosstie run: a job folder, step by step, only what is out of date

#include "app/steps.h"
#include "app/steps_calibrate.h"
#include "app/verb.h"

#include <fmt/core.h>

namespace crosstie::app {
namespace {

using base::Result;

/// Says what a step did and folds its outcome into that of the run.
void tell(Session& session, const char* verb, const StepOutcome& step, Outcome& outcome) {
  session.say(
      fmt::format("{:<8}{}{}", verb, step.summary, step.outcome == Outcome::kVerdictFailed ? "  (a verdict FAILs)" : ""));
  session.print((step.folder / "report.html").string());
  if (step.outcome == Outcome::kVerdictFailed) outcome = Outcome::kVerdictFailed;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  for (const std::string& section : job->unused)
    session.say(fmt::format("[{}] of the job is not used by this version", section));
  const auto out = arguments.get("--out");
  const std::filesystem::path results = out ? std::filesystem::path(*out) : job->folder / "results";
  Outcome outcome = Outcome::kOk;

  if (job->board) {
    const auto boards = calibration_task(*job);
    if (!boards) return tl::unexpected(boards.error());
    const auto calibration = calibrate_step(*boards, results / "calibrate", session);
    if (!calibration) return tl::unexpected(calibration.error());
    tell(session, "calibrate  ", *calibration, outcome);
    if (!job->network) return outcome;
  }
  if (const auto scale = check_scale(*job); !scale) return tl::unexpected(scale.error());
  const auto task = detection_task(*job);
  if (!task) return tl::unexpected(task.error());
  const auto detection = detect_step(*task, results / "detect", false, session);
  if (!detection) return tl::unexpected(detection.error());
  tell(session, "detect", *detection, outcome);

  const auto adjustment = adjust_step(*job, detection->folder, results / "adjust", session);
  if (!adjustment) return tl::unexpected(adjustment.error());
  tell(session, "adjust", *adjustment, outcome);

  if (!job->reference_points) return outcome;
  const auto comparison = verification_task(*job, adjustment->folder);
  if (!comparison) return tl::unexpected(comparison.error());
  const auto verification = verify_step(*comparison, results / "verify", session);
  if (!verification) return tl::unexpected(verification.error());
  tell(session, "verify", *verification, outcome);
  return outcome;
}

}  // namespace

Verb run_verb() {
  return {"run",
          "do all that a job asks for, recomputing only what changed",
          "  $ crosstie run cross\n"
          "  detect  24 images, 1042 coded markers\n"
          "  adjust  57 points (9 uncoded) from 24 images, sigma0 0.0025 px, redundancy 1974, 12 rejected, 2 warnings\n"
          "  verify  44 points, RMS 0.0084 0.0071 0.0085 mm (x y z), deviation over predicted sigma 0.93; 0 of 9 uncoded have "
          "a partner",
          {{"JOB", "JOB", "job folder or its job.toml", true, false},
           {"--out", "DIR", "folder for the results of all steps, DIR/<verb>/ (default: JOB/results)", false, false}},
          run};
}

}  // namespace crosstie::app
