// crosstie scan: fringe images of two cameras -> cloud

#include <array>

#include <fmt/core.h>

#include "app/steps_scan.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr double kDegree = 0.017453292519943295;

Result<ScanTask> task_of(const Arguments& arguments, Session& session) {
  ScanTask task;
  task.head = *arguments.get("--rig");
  task.left = *arguments.get("--left");
  task.right = *arguments.get("--right");
  task.manifest = *arguments.get("--manifest");
  task.base_folder = std::filesystem::current_path();
  task.write_covariance = arguments.has("--covariance");
  task.decode.threads = task.match.threads = task.cloud.threads = session.threads();
  struct Number {
    const char* name;
    double* value;
    double unit;
  };
  const std::array<Number, 4> numbers = {{{"--min-depth-mm", &task.match.min_depth_mm, 1.0},
                                          {"--max-depth-mm", &task.match.max_depth_mm, 1.0},
                                          {"--max-grazing-deg", &task.cloud.max_grazing_rad, kDegree},
                                          {"--max-phase-sigma-rad", &task.decode.max_phase_sigma_rad, 1.0}}};
  for (const Number& number : numbers) {
    const auto given = arguments.number(number.name);
    if (!given) return tl::unexpected(given.error());
    if (*given) *number.value = **given * number.unit;
  }
  for (const auto& [name, value] :
       {std::pair{"--guard-px", &task.match.guard_px}, std::pair{"--filter-px", &task.cloud.filter_radius_px}}) {
    const auto given = arguments.integer(name);
    if (!given) return tl::unexpected(given.error());
    if (*given && (**given < 0 || **given > 100)) return base::fail(ErrorCode::kUsage, fmt::format("{} is 0 to 100", name));
    if (*given) *value = static_cast<int>(**given);
  }
  const auto read = arguments.number("--noise-read");
  if (!read) return tl::unexpected(read.error());
  const auto shot = arguments.number("--noise-shot");
  if (!shot) return tl::unexpected(shot.error());
  if (*read || *shot) task.decode.noise = base::GreyNoise{read->value_or(0.0), shot->value_or(0.0)};
  return task;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto task = task_of(arguments, session);
  if (!task) return tl::unexpected(task.error());
  const auto step = scan_step(*task, *arguments.get("--out"), session);
  if (!step) return tl::unexpected(step.error());
  session.say("scan    " + step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

}  // namespace

Verb scan_verb() {
  return {"scan",
          "make a cloud with a sigma for each point from the fringe images of two calibrated cameras",
          "  $ crosstie scan --rig job/results/calibrate --left x0850/left --right x0850/right \\\n"
          "      --manifest patterns/patterns.json --out x0850/cloud\n"
          "  scan    1838994 points, median sigma 0.0777 mm\n"
          "  x0850/cloud/result.json",
          {{"--rig", "RIG", "folder of a calibrate result, or INTRINSIC.yml,EXTRINSIC.yml of OpenCV's stereo calibration (mm)",
            true, false},
           {"--left", "DIR", "folder of the left camera's images", true, false},
           {"--right", "DIR", "folder of the right camera's images", true, false},
           {"--manifest", "FILE", "which image shows what: patterns.json as patterns writes it", true, false},
           {"--out", "DIR", "folder for cloud.ply, depth.tiff and report; replaced as a whole", true, false},
           {"--min-depth-mm", "MM", "nearest depth that is taken (default 0)", false, false},
           {"--max-depth-mm", "MM", "farthest depth that is taken", false, false},
           {"--guard-px", "PX", "pixels nearer than this to the end of a surface are left out (default 2)", false, false},
           {"--filter-px", "PX",
            "average depths over squares of 2 n + 1 pixels; the result states the correlation length (default 0: none)", false,
            false},
           {"--max-grazing-deg", "DEG", "largest angle between normal and viewing ray (default 70)", false, false},
           {"--max-phase-sigma-rad", "RAD", "largest sigma of a phase that is taken (default 0.2)", false, false},
           {"--noise-read", "LEVELS2", "variance of a grey level without light, where the images cannot tell it (three steps)",
            false, false},
           {"--noise-shot", "LEVELS", "growth of that variance with the level", false, false},
           {"--covariance", "", "write six covariances a point into cloud.ply", false, false}},
          run};
}

}  // namespace crosstie::app
