// crosstie edge: stitched scans, or one -> the edge of a hole

#include <fmt/core.h>

#include "app/job_edge.h"
#include "app/job_index.h"
#include "app/steps_edge.h"
#include "app/verb.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr double kDegree = 0.017453292519943295;

/// `count` numbers with commas between them; nothing where the option was not given.
Result<std::optional<std::vector<double>>> numbers(const Arguments& arguments, const std::string& name, std::size_t count) {
  const auto text = arguments.get(name);
  if (!text) return std::optional<std::vector<double>>();
  std::vector<double> values;
  for (const std::string_view part : base::split(*text, ',')) {
    const auto value = base::parse_double(part);
    if (!value)
      return base::fail(ErrorCode::kUsage, fmt::format("{} takes {} numbers with commas, not '{}'", name, count, *text));
    values.push_back(*value);
  }
  if (values.size() != count)
    return base::fail(ErrorCode::kUsage, fmt::format("{} takes {} numbers with commas, not '{}'", name, count, *text));
  return std::optional(values);
}

Result<EdgeTask> scan_task_of(const Arguments& arguments) {
  EdgeTask task;
  task.scan = *arguments.get("--scan");
  task.head = arguments.get("--rig").value_or("");
  task.nominal = arguments.get("--nominal").value_or("circle");
  task.base_folder = std::filesystem::current_path();
  task.title = task.scan.filename().string();
  const auto roi = numbers(arguments, "--roi", 4);
  if (!roi) return tl::unexpected(roi.error());
  if (*roi) task.options.roi_px = {(**roi)[0], (**roi)[1], (**roi)[2], (**roi)[3]};
  const auto arc = numbers(arguments, "--arc", 2);
  if (!arc) return tl::unexpected(arc.error());
  if (*arc) task.options.arc_rad = {(**arc)[0] * kDegree, (**arc)[1] * kDegree};
  const auto cell = arguments.number("--cell-mm");
  if (!cell) return tl::unexpected(cell.error());
  if (*cell) task.options.cell_mm = **cell;
  if (auto ok = task.options.validate(); !ok) return base::fail(std::move(ok));
  return task;
}

Result<Outcome> finish(const Result<StepOutcome>& step, Session& session) {
  if (!step) return tl::unexpected(step.error());
  session.say("edge    " + step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

Result<Outcome> edge_of_job(const Arguments& arguments, Session& session) {
  for (const char* option : {"--rig", "--nominal", "--roi", "--arc", "--cell-mm"}) {
    if (arguments.has(option))
      return base::fail(ErrorCode::kUsage, fmt::format("{} goes with --scan; a JOB says it in job.toml", option));
  }
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const std::filesystem::path results = job->folder / "results";
  const auto task = job_edge_task(*job, results);
  if (!task) return tl::unexpected(task.error());
  if (const auto out = arguments.get("--out")) return finish(job_edge_step(*task, *out, session), session);
  return with_index(*job, finish(job_edge_step(*task, results / "edge", session), session));
}

Result<Outcome> edge_of_scan(const Arguments& arguments, Session& session) {
  const auto out = arguments.get("--out");
  if (!out) return base::fail(ErrorCode::kUsage, "--scan needs --out, the folder for the result");
  const auto task = scan_task_of(arguments);
  if (!task) return tl::unexpected(task.error());
  return finish(edge_step(*task, *out, session), session);
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  if (arguments.has("JOB") == arguments.has("--scan")) {
    return base::fail(ErrorCode::kUsage, "edge needs a JOB whose scans were stitched, or --scan with the folder of one scan");
  }
  return arguments.has("JOB") ? edge_of_job(arguments, session) : edge_of_scan(arguments, session);
}

}  // namespace

Verb edge_verb() {
  return {
      "edge",
      "find the edge of a hole as a curve with sigmas: of a job's stitched scans, with the part's place and the torch's path, "
      "or of one scan",
      "  $ crosstie edge door\n"
      "  edge    236 points over 3269.7 mm, closed, 0 gaps; points, rms 0.504 mm; path 3269.9 mm in 327 s\n"
      "  door/results/edge/result.json\n"
      "  $ crosstie edge --scan x0850/cloud --nominal circle --roi 480,420,770,720 --arc 20,160 --out x0850/edge\n"
      "  x0850/edge/result.json",
      {{"JOB", "JOB", "job folder or its job.toml, after stitch", false, false},
       {"--scan", "DIR", "instead: folder of one scan's result; the edge is found in its rig's frame", false, false},
       {"--rig", "RIG", "the head where it does not lie any more where the scan found it, as scan --rig has it", false, false},
       {"--nominal",
        "WORD",
        "circle, ellipse, oval, superellipse, or a file with the nominal's points in mm; it is fitted to the edge (default "
        "circle)",
        false,
        false,
        1,
        {"circle", "ellipse", "oval", "superellipse"}},
       {"--roi", "U0,V0,U1,V1", "part of the left image in which the hole lies [px] (default: all of it)", false, false},
       {"--arc", "FROM,TO",
        "part of the rim [deg], by the angle in the left image about the middle of the region, from the right downwards "
        "(default: "
        "all of it)",
        false, false},
       {"--cell-mm", "MM", "extent of rim that one point stands for (default: what one edge pixel is found on)", false, false},
       {"--out", "DIR", "folder for edge.csv, path and report; replaced as a whole (default: JOB/results/edge)", false, false}},
      run};
}

}  // namespace crosstie::app
