// crosstie verify: coordinates against a reference

#include <fmt/core.h>

#include "app/steps.h"
#include "app/steps_acceptance.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::Result;

/// The cloud and the rim, where they are named.
Result<std::optional<SurfaceTask>> surfaces(const Arguments& arguments, const JobLimits& limits) {
  SurfaceTask task;
  task.limits = limits;
  for (const auto& [option, file] : {std::pair{"--cloud", &task.cloud}, std::pair{"--surface", &task.surface},
                                     std::pair{"--edge", &task.edge}, std::pair{"--edge-reference", &task.edge_reference}}) {
    if (const auto value = arguments.get(option)) *file = *value;
  }
  task.shell = arguments.get("--shell").value_or("");
  task.best_fit = arguments.has("--best-fit");
  const auto usage = [](const char* what) { return base::fail(base::ErrorCode::kUsage, what); };
  if (!task.shell.empty() && task.shell != "cone" && task.shell != "cylinder") return usage("--shell is cone or cylinder");
  if ((task.surface || !task.shell.empty() || task.best_fit) && !task.cloud)
    return usage("--surface, --shell and --best-fit need --cloud");
  if (task.cloud && !task.surface && task.shell.empty()) return usage("--cloud needs --surface, a mesh or cloud, or --shell");
  if (task.best_fit && !task.surface) return usage("--best-fit needs --surface");
  if (task.edge.has_value() != task.edge_reference.has_value()) return usage("--edge and --edge-reference go together");
  if (!task.cloud && !task.edge) return std::optional<SurfaceTask>();
  return std::optional<SurfaceTask>(task);
}

/// --acceptance and --repeat stand alone: a test of the scanner, or of its sigmas, and no comparison with a reference.
Result<StepOutcome> test(const Arguments& arguments, Session& session) {
  const bool acceptance = arguments.has("--acceptance");
  for (const Option& option : verify_verb().options) {
    const bool own = option.name == "--out" || option.name == (acceptance ? "--acceptance" : "--repeat") ||
                     (!acceptance && option.name == "--max-ratio");
    if (!own && arguments.has(option.name))
      return base::fail(base::ErrorCode::kUsage,
                        fmt::format("{} does not go with {}", option.name, acceptance ? "--acceptance" : "--repeat"));
  }
  const std::filesystem::path out = *arguments.get("--out");
  if (acceptance) return acceptance_step(*arguments.get("--acceptance"), out, session);
  const auto ratio = arguments.number("--max-ratio");
  if (!ratio) return tl::unexpected(ratio.error());
  if (*ratio && !(**ratio > 0.0)) return base::fail(base::ErrorCode::kUsage, "--max-ratio must be positive");
  std::vector<std::filesystem::path> runs;
  for (const std::string& run : arguments.all("--repeat")) runs.emplace_back(run);
  return repeat_step(runs, *ratio, out, session);
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  if (arguments.has("--acceptance") || arguments.has("--repeat")) {
    const auto step = test(arguments, session);
    if (!step) return tl::unexpected(step.error());
    session.say(step->summary);
    session.print((step->folder / "result.json").string());
    return step->outcome;
  }
  if (arguments.has("--max-ratio")) return base::fail(base::ErrorCode::kUsage, "--max-ratio goes with --repeat");
  VerificationTask task;
  task.measured = arguments.get("--points").value_or("");
  task.reference = arguments.get("--reference").value_or("");
  task.reference_unit = arguments.get("--unit").value_or("");
  task.base_folder = std::filesystem::current_path();
  task.fit = arguments.get("--fit").value_or("rigid");
  const auto a_mm = arguments.number("--mpe-a-mm");
  if (!a_mm) return tl::unexpected(a_mm.error());
  const auto k = arguments.number("--mpe-k");
  if (!k) return tl::unexpected(k.error());
  task.limits.length_mpe_a_mm = *a_mm;
  task.limits.length_mpe_k = *k;
  const auto tolerance_mm = arguments.number("--tolerance-mm");
  if (!tolerance_mm) return tl::unexpected(tolerance_mm.error());
  task.limits.surface_tolerance_mm = tolerance_mm->value_or(task.limits.surface_tolerance_mm);
  if (const auto pairs = arguments.get("--scale-from")) {
    const auto pair = parse_id_pair(*pairs);
    if (!pair) return tl::unexpected(pair.error());
    task.not_tested.push_back(*pair);
  }
  auto surface = surfaces(arguments, task.limits);
  if (!surface) return base::fail(std::move(surface));
  task.surface = *std::move(surface);
  if (task.measured.empty() != task.reference.empty()) {
    return base::fail(base::ErrorCode::kUsage, "--points and --reference go together");
  }
  if (!task.has_points() && !task.surface) {
    return base::fail(
        base::ErrorCode::kUsage,
        "nothing to verify: --points with --reference, --cloud, --edge with --edge-reference, --acceptance, or --repeat");
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
          "compare coordinates, clouds and rims with a reference; test a scanner (VDI/VDE 2634) and whether results repeat",
          "  $ crosstie verify --points results/adjust/result.json --reference tritop.csv --out check\n"
          "  44 points, RMS 0.0084 0.0071 0.0085 mm (x y z), deviation over predicted sigma 0.93\n"
          "  check/result.json\n"
          "  $ crosstie verify --cloud results/stitch/cloud.ply --surface atos.ply --tolerance-mm 0.2 --out check\n"
          "  98421 points against a mesh: mean 0.012 mm, scatter 0.041 mm, 99.7 % within 0.2 mm\n"
          "  check/result.json\n"
          "  $ crosstie verify --acceptance head2/acceptance.toml --out accepted\n"
          "  PF 0.2514 +- 0.0102 mm (10 of 10 positions), PS -0.0041 +- 0.0035 mm (10 of 10 positions)\n"
          "  accepted/result.json",
          {{"--points", "FILE", "measured: the result.json of adjust, or a point list", false, false},
           {"--reference", "FILE", "known coordinates: a point list or an AICON object list", false, false},
           {"--unit",
            "UNIT",
            "unit of the reference where its columns do not say: mm, m, inch",
            false,
            false,
            1,
            {"mm", "m", "inch"}},
           {"--fit",
            "FIT",
            "rigid (6 degrees of freedom, default), similarity (7), none",
            false,
            false,
            1,
            {"rigid", "similarity", "none"}},
           {"--scale-from", "ID,ID", "distance that defined the scale; it is no test length", false, false},
           {"--mpe-a-mm", "MM", "A of the maximum permissible length error A + L/K; judged where given", false, false},
           {"--mpe-k", "K", "K of it, mm of length per mm of error (20000 = 50 um per metre)", false, false},
           {"--cloud", "FILE", "measured cloud (PLY, mm)", false, false},
           {"--surface", "FILE", "its reference: a mesh or a cloud (PLY, mm) in the same frame", false, false},
           {"--best-fit", "",
            "lay the cloud onto the surface first (ICP, point to plane); what the surface does not hold stays", false, false},
           {"--shell",
            "SHAPE",
            "cone or cylinder: fitted to the cloud; axis, diameters and angle with sigmas",
            false,
            false,
            1,
            {"cone", "cylinder"}},
           {"--tolerance-mm", "MM", "whose share of the cloud is told (default 0.3)", false, false},
           {"--edge", "FILE", "measured rim: edge.csv of edge", false, false},
           {"--edge-reference", "FILE", "its reference: x_mm,y_mm,z_mm,nx,ny,nz[,sigma_u_mm,sigma_v_mm] in order along it",
            false, false},
           {"--acceptance", "FILE",
            "instead: an acceptance test of a scanner after VDI/VDE 2634 part 2 or 3, spheres, ball bar and plate (TOML)",
            false, false},
           {"--repeat", "RESULT",
            "instead: two or more results of the same thing (adjust, edge, verify --acceptance): do they repeat as their "
            "sigmas say",
            false, true},
           {"--max-ratio", "X", "with --repeat: limit of scatter over predicted sigma; judged where given", false, false},
           {"--out", "DIR", "folder for the result; replaced as a whole", true, false}},
          run};
}

}  // namespace crosstie::app
