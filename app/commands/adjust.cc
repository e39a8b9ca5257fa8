// crosstie adjust: observations of a network -> coordinates with sigmas

#include "app/steps.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::Result;

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto results = job->folder / "results";
  if (const auto scale = check_scale(*job); !scale) return tl::unexpected(scale.error());
  const auto task = detection_task(*job);
  if (!task) return tl::unexpected(task.error());
  const auto detection = detect_step(*task, results / "detect", false, session);
  if (!detection) return tl::unexpected(detection.error());
  session.say("detect  " + detection->summary);

  const auto out = arguments.get("--out");
  const auto adjustment = adjust_step(*job, detection->folder, out ? std::filesystem::path(*out) : results / "adjust", session);
  if (!adjustment) return tl::unexpected(adjustment.error());
  session.say("adjust  " + adjustment->summary);
  session.print((adjustment->folder / "result.json").string());
  return adjustment->outcome;
}

}  // namespace

Verb adjust_verb() {
  return {"adjust",
          "bundle-adjust a network of photographs: coordinates, poses and lenses with full covariance",
          "  $ crosstie adjust cross\n"
          "  detect  24 images, up to date\n"
          "  adjust  48 points from 24 images, sigma0 0.0025 px, redundancy 1831, 13 rejected, 1 warnings\n"
          "  cross/results/adjust/result.json",
          {{"JOB", "JOB", "job folder or its job.toml", true, false},
           {"--out", "DIR", "folder for the result (default: JOB/results/adjust); replaced as a whole", false, false}},
          run};
}

}  // namespace crosstie::app
