// crosstie commission: the head in the machine's frame

#include <fmt/core.h>

#include "app/commission_run.h"
#include "app/steps_commission.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto results = job->folder / "results";
  if (auto complete = check_commission(*job); !complete) return base::fail(std::move(complete));
  const auto tell = [&](const char* verb, const StepOutcome& step) {
    session.say(fmt::format("{:<11}{}", verb, step.summary));
  };
  const auto sources = commission_sources(*job, results, tell, session);
  if (!sources) return tl::unexpected(sources.error());
  const auto out = arguments.get("--out");
  const auto step = commission_step(*job, *sources, out ? std::filesystem::path(*out) : results / "commission", session);
  if (!step) return tl::unexpected(step.error());
  tell("commission", *step);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

}  // namespace

Verb commission_verb() {
  return {"commission",
          "tie the scanning head to the machine's frame: rig, axis, error motions, with covariance",
          "  $ crosstie commission machine\n"
          "  calibrate  51 images of 2 cameras, opencv5, rms 0.034 px (held out 0.036 px), baseline 800.641 +- 0.033 mm, 3 "
          "rejected, 8 "
          "warnings\n"
          "  stations   10 images, 349 coded markers\n"
          "  commission 5 stations from 0.0068 to 999.994 mm, direction +- 0.014 mrad, scale 80 +- 14 ppm, EYX EAX EBX, FRE "
          "0.008 mm, "
          "sigma0 0.0023 px, 0 rejected, 2 warnings\n"
          "  machine/results/commission/result.json",
          {{"JOB", "JOB", "job folder or its job.toml", true, false},
           {"--out", "DIR", "folder for the result (default: JOB/results/commission); replaced as a whole", false, false}},
          run};
}

}  // namespace crosstie::app
