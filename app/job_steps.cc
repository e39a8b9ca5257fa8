// The steps of a job: what each one needs, reads and does.

#include "app/job_steps.h"

#include <algorithm>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/job_edge.h"
#include "app/job_scan.h"
#include "app/steps_calibrate.h"
#include "app/steps_commission.h"
#include "app/steps_stitch.h"
#include "base/pattern_sequence.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using Files = std::vector<fs::path>;
using Names = std::vector<std::string_view>;

Result<> nothing_to_check(const Job& /*job*/) { return {}; }

/// Photographs of a task, where the job has one.
template <typename Task>
Result<Files> photographs(const Result<Task>& task) {
  if (!task) return tl::unexpected(task.error());
  Files files;
  for (const ImageFile& image : task->images) files.push_back(image.path);
  return files;
}

void add(const Job& job, const std::optional<fs::path>& path, Files& files) {
  if (path) files.push_back(job.resolve(*path));
}

/// Whether the job calibrates any of the cameras that photograph the network.
bool network_is_calibrated_here(const Job& job) {
  const std::vector<std::string> calibrated = job.board_cameras();
  return job.network && std::any_of(job.network->images.begin(), job.network->images.end(), [&](const auto& images) {
           return std::find(calibrated.begin(), calibrated.end(), images.first) != calibrated.end();
         });
}

JobStep calibrate() {
  return {"calibrate",
          "calibrate",
          [](const Job& job) { return job.board.has_value(); },
          [](const Job& /*job*/) { return Names{}; },
          nothing_to_check,
          [](const Job& job) { return photographs(calibration_task(job)); },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto task = calibration_task(at.job);
            if (!task) return tl::unexpected(task.error());
            return calibrate_step(*task, out, at.session);
          }};
}

JobStep detect() {
  return {"detect",
          "detect",
          [](const Job& job) { return job.network.has_value(); },
          [](const Job& /*job*/) { return Names{}; },
          nothing_to_check,
          [](const Job& job) { return photographs(detection_task(job)); },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto task = detection_task(at.job);
            if (!task) return tl::unexpected(task.error());
            return detect_step(*task, out, false, at.session);
          }};
}

JobStep adjust() {
  return {"adjust",
          "adjust",
          [](const Job& job) { return job.network.has_value(); },
          [](const Job& job) {
            return network_is_calibrated_here(job) ? Names{"calibrate", "detect"} : Names{"detect"};
          },
          check_scale,
          [](const Job& job) -> Result<Files> {
            Files files;
            add(job, job.network->scale_bars, files);
            add(job, job.network->control, files);
            add(job, job.network->datum, files);
            if (job.network->scale_from) add(job, job.reference_points, files);
            return files;
          },
          [](const StepRun& at, const fs::path& out) { return adjust_step(at.job, at.results / "detect", out, at.session); }};
}

/// The markers of the cross in the photographs of the stations.
JobStep stations() {
  return {"stations",
          "detect-stations",
          [](const Job& job) { return job.cross.has_value(); },
          [](const Job& /*job*/) { return Names{}; },
          check_commission,
          [](const Job& job) { return photographs(station_detection_task(job)); },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto task = station_detection_task(at.job);
            if (!task) return tl::unexpected(task.error());
            return detect_step(*task, out, false, at.session);
          }};
}

JobStep commission() {
  return {"commission",
          "commission",
          [](const Job& job) { return job.cross.has_value(); },
          [](const Job& job) {
            Names names;
            if (is_calibrated_here(job)) names.emplace_back("calibrate");
            if (!job.cross->points) names.emplace_back("adjust");
            names.emplace_back("stations");
            return names;
          },
          check_commission,
          [](const Job& job) -> Result<Files> {
            Files files;
            add(job, job.cross->points, files);
            add(job, job.cross->spheres, files);
            add(job, job.machine->probed_spheres, files);
            add(job, job.machine->probe_hits, files);
            return files;
          },
          [](const StepRun& at, const fs::path& out) {
            const CommissionSources sources{at.results / "calibrate", at.results / "adjust", at.results / "detect-stations"};
            return commission_step(at.job, sources, out, at.session);
          }};
}

Result<Files> fringe_images(const Job& job) {
  Files files;
  for (const JobStation& station : job.stations) {
    if (!station.scan) continue;
    files.push_back(job.resolve(station.scan->manifest));
    const auto sequence = base::read_pattern_manifest(files.back());
    if (!sequence) return tl::unexpected(sequence.error());
    for (const base::Pattern& pattern : sequence->patterns) {
      files.push_back(job.resolve(station.scan->left / pattern.files[0]));
      files.push_back(job.resolve(station.scan->right / pattern.files[1]));
    }
  }
  return files;
}

/// The fringe images of every station that has some, each with a folder of its own in the result's.
JobStep scan() {
  return {"scan",
          "scan",
          [](const Job& job) {
            return std::any_of(job.stations.begin(), job.stations.end(),
                               [](const JobStation& one) { return one.scan.has_value(); });
          },
          [](const Job& job) {
            if (job.cross) return Names{"commission"};
            return is_calibrated_here(job) ? Names{"calibrate"} : Names{};
          },
          nothing_to_check,
          fringe_images,
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto head = scan_head(at.job, at.results, at.session);
            if (!head) return tl::unexpected(head.error());
            const auto scans = station_scans(at.job, head->string(), std::nullopt, out);
            if (!scans) return tl::unexpected(scans.error());
            bool current = true;
            std::string summary;
            const auto tell = [&](const std::string& what, const StepOutcome& step) {
              current = current && step.current;
              at.session.print((step.folder / "report.html").string());
              summary += fmt::format("{}{}: {}", summary.empty() ? "" : "; ", what.substr(what.find(' ') + 1), step.summary);
            };
            const auto outcome = scan_stations(*scans, tell, at.session);
            if (!outcome) return tl::unexpected(outcome.error());
            return StepOutcome{out, summary, current, *outcome};
          },
          [](const Job& job) {
            std::vector<std::string> stations;
            for (const JobStation& one : job.stations) {
              if (one.scan) stations.push_back(one.name);
            }
            return stations;
          }};
}

/// A single scan can be put where it belongs by the axis or by the markers' list alone.
bool has_stitch(const Job& job) {
  const auto scans =
      std::count_if(job.stations.begin(), job.stations.end(), [](const JobStation& one) { return one.scan.has_value(); });
  return scans > 1 || (scans == 1 && (job.cross || (job.hole && job.hole->markers)));
}

bool has_edge(const Job& job) { return has_stitch(job) && job.hole && !job.hole->nominal.empty(); }

JobStep stitch() {
  return {"stitch",
          "stitch",
          has_stitch,
          [](const Job& job) {
            Names names{"scan"};
            if (job.cross) names.emplace_back("commission");
            return names;
          },
          nothing_to_check,
          [](const Job& job) -> Result<Files> {
            Files files;
            if (job.hole) add(job, job.hole->markers, files);
            return files;
          },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            auto task = stitch_task(at.job, at.results);
            if (!task) return tl::unexpected(task.error());
            task->stitch.threads = at.session.threads();
            return stitch_step(*task, out, at.session);
          }};
}

JobStep edge() {
  return {"edge",
          "edge",
          has_edge,
          [](const Job& /*job*/) {
            return Names{"scan", "stitch"};
          },
          nothing_to_check,
          [](const Job& job) -> Result<Files> { return job_edge_files(job); },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto task = job_edge_task(at.job, at.results);
            if (!task) return tl::unexpected(task.error());
            return job_edge_step(*task, out, at.session);
          }};
}

bool verifies_points(const Job& job) { return job.network && job.reference_points; }
bool verifies_surface(const Job& job) { return has_stitch(job) && (job.reference_surface || job.part.radius_mm); }

JobStep verify() {
  return {"verify",
          "verify",
          [](const Job& job) { return verifies_points(job) || verifies_surface(job); },
          [](const Job& job) {
            Names names;
            if (verifies_points(job)) names.emplace_back("adjust");
            if (verifies_surface(job)) names.emplace_back("stitch");
            if (verifies_surface(job) && has_edge(job)) names.emplace_back("edge");
            return names;
          },
          nothing_to_check,
          [](const Job& job) -> Result<Files> {
            Files files;
            if (verifies_points(job)) add(job, job.reference_points, files);
            if (verifies_surface(job)) add(job, job.reference_surface, files);
            return files;
          },
          [](const StepRun& at, const fs::path& out) -> Result<StepOutcome> {
            const auto task = verification_task(at.job, at.results);
            if (!task) return tl::unexpected(task.error());
            return verify_step(*task, out, at.session);
          }};
}

}  // namespace

const std::vector<JobStep>& job_steps() {
  static const std::vector<JobStep> table = {
      calibrate(),   // images of the board     -> lenses, rig
      detect(),      // photographs of the net  -> image points
      adjust(),      // image points            -> coordinates
      stations(),    // photographs of the cross by the head -> image points
      commission(),  // lenses, rig, cross, spheres, image points -> the head in the machine's frame
      scan(),        // fringe images of the stations, the head -> clouds
      stitch(),      // clouds, markers, axis, list of markers -> one cloud in the machine's frame
      edge(),        // edge pixels, clouds, nominal -> the hole's edge, the part's place, the torch's path
      verify(),      // coordinates, cloud, references -> deviations
  };
  return table;
}

std::vector<const JobStep*> steps_of(const Job& job) {
  std::vector<const JobStep*> steps;
  for (const JobStep& step : job_steps()) {
    if (step.wanted(job)) steps.push_back(&step);
  }
  return steps;
}

Result<std::vector<const JobStep*>> steps_until(const Job& job, std::string_view name) {
  const std::vector<const JobStep*> asked = steps_of(job);
  const auto last = std::find_if(asked.begin(), asked.end(), [&](const JobStep* step) { return step->name == name; });
  if (last == asked.end()) {
    Names names;
    for (const JobStep* step : asked) names.push_back(step->name);
    const bool known =
        std::any_of(job_steps().begin(), job_steps().end(), [&](const JobStep& step) { return step.name == name; });
    return base::fail(known ? ErrorCode::kBadInput : ErrorCode::kUsage,
                      fmt::format("{}: '{}' is no step of this job; it has {}", job.file.string(), name,
                                  names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  // Backwards, since what a step needs stands before it.
  Names needed{name};
  std::vector<const JobStep*> steps;
  for (auto step = std::make_reverse_iterator(last + 1); step != asked.rend(); ++step) {
    if (std::find(needed.begin(), needed.end(), (*step)->name) == needed.end()) continue;
    steps.insert(steps.begin(), *step);
    const Names more = (*step)->needs(job);
    needed.insert(needed.end(), more.begin(), more.end());
  }
  return steps;
}

std::vector<WantedResult> results_of(const JobStep& step, const Job& job) {
  const std::string name(step.name);
  if (step.parts == nullptr) return {{name, step.folder}};
  std::vector<WantedResult> results;
  for (const std::string& part : step.parts(job))
    results.push_back({fmt::format("{} {}", name, part), fs::path(step.folder) / part});
  return results;
}

Result<> do_steps(const std::vector<const JobStep*>& steps, const StepRun& run, const TellStep& tell) {
  for (const JobStep* step : steps) {
    if (auto complete = step->check(run.job); !complete) return complete;
  }
  run.session.set_job_results(run.results);
  for (const JobStep* step : steps) {
    const auto done = step->run(run, run.results / step->folder);
    if (!done) return tl::unexpected(done.error());
    tell(*step, *done);
  }
  return {};
}

Result<> prepare(std::string_view name, const StepRun& run, const TellStep& tell) {
  auto steps = steps_until(run.job, name);
  if (!steps) return tl::unexpected(steps.error());
  if (auto complete = steps->back()->check(run.job); !complete) return complete;
  steps->pop_back();
  return do_steps(*steps, run, tell);
}

}  // namespace crosstie::app
