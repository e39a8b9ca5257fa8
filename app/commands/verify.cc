// crosstie verify: coordinates against a reference

#include "app/steps.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::Result;

Result<Outcome> run(const Arguments& arguments, Session& session) {
  VerificationTask task;
  task.measured = *arguments.get("--points");
  task.reference = *arguments.get("--reference");
  task.reference_unit = arguments.get("--unit").value_or("");
  task.base_folder = std::filesystem::current_path();
  task.fit = arguments.get("--fit").value_or("rigid");
  const auto a_mm = arguments.number("--mpe-a-mm");
  if (!a_mm) return tl::unexpected(a_mm.error());
  const auto k = arguments.number("--mpe-k");
  if (!k) return tl::unexpected(k.error());
  task.limits.length_mpe_a_mm = *a_mm;
  task.limits.length_mpe_k = *k;
  if (const auto pairs = arguments.get("--scale-from")) {
    const auto pair = parse_id_pair(*pairs);
    if (!pair) return tl::unexpected(pair.error());
    task.not_tested.push_back(*pair);
  }
  const auto step = verify_step(task, *arguments.get("--out"), session);
  if (!step) return tl::unexpected(step.error());
  session.say(step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

}  // namespace

Verb verify_verb() {
  return {"verify",
          "compare measured coordinates with a reference: best fit, deviations, length errors",
          "  $ crosstie verify --points results/adjust/result.json --reference tritop.csv --out check\n"
          "  44 points, RMS 0.0084 0.0071 0.0085 mm (x y z), deviation over predicted sigma 0.93\n"
          "  check/result.json",
          {{"--points", "FILE", "measured: the result.json of adjust, or a point list", true, false},
           {"--reference", "FILE", "known coordinates: a point list or an AICON object list", true, false},
           {"--unit", "UNIT", "unit of the reference where its columns do not say: mm, m, inch", false, false},
           {"--fit", "FIT", "rigid (6 degrees of freedom, default), similarity (7), none", false, false},
           {"--scale-from", "ID,ID", "distance that defined the scale; it is no test length", false, false},
           {"--mpe-a-mm", "MM", "A of the maximum permissible length error A + L/K; judged where given", false, false},
           {"--mpe-k", "K", "K of it, mm of length per mm of error (20000 = 50 um per metre)", false, false},
           {"--out", "DIR", "folder for the result; replaced as a whole", true, false}},
          run};
}

}  // namespace crosstie::app
