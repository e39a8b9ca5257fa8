// crosstie scan: fringe images of two cameras -> cloud

#include <array>

#include <fmt/core.h>

#include "app/job_index.h"
#include "app/job_scan.h"
#include "app/steps.h"
#include "app/steps_scan.h"
#include "app/verb.h"
#include "markers/family.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr double kDegree = 0.017453292519943295;

/// What the command line says of decoding, matching and the cloud.
Result<> read_options(const Arguments& arguments, Session& session, ScanTask& task) {
  task.write_covariance = arguments.has("--covariance");
  task.write_pcd = arguments.has("--pcd");
  task.match.guard_creases = arguments.has("--guard-creases");
  task.decode.threads = task.match.threads = task.cloud.threads = task.edges.threads = session.threads();
  struct Number {
    const char* name;
    double* value;
    double unit;
  };
  const std::array<Number, 6> numbers = {{{"--min-depth-mm", &task.match.min_depth_mm, 1.0},
                                          {"--max-depth-mm", &task.match.max_depth_mm, 1.0},
                                          {"--max-grazing-deg", &task.cloud.max_grazing_rad, kDegree},
                                          {"--max-phase-sigma-rad", &task.decode.max_phase_sigma_rad, 1.0},
                                          {"--max-movement-px", &task.decode.max_movement_px, 1.0},
                                          {"--max-light-change", &task.decode.max_light_change, 0.01}}};
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
  const auto off_curve = arguments.number("--max-off-curve-px");
  if (!off_curve) return tl::unexpected(off_curve.error());
  task.max_off_curve_px = *off_curve;
  const auto read = arguments.number("--noise-read");
  if (!read) return tl::unexpected(read.error());
  const auto shot = arguments.number("--noise-shot");
  if (!shot) return tl::unexpected(shot.error());
  if (*read || *shot) task.decode.noise = base::GreyNoise{read->value_or(0.0), shot->value_or(0.0)};
  return {};
}

Result<> read_markers(const Arguments& arguments, ScanTask& task) {
  const auto family_name = arguments.get("--family");
  for (const char* option : {"--ids", "--thickness-mm", "--dot-diameter-mm"}) {
    if (arguments.has(option) && !family_name)
      return base::fail(ErrorCode::kUsage, fmt::format("{} needs --family: which markers there are", option));
  }
  if (!family_name) return {};
  auto family = markers::marker_family(*family_name);
  if (!family) return base::fail(std::move(family));
  ScanMarkers markers{std::move(*family), {}, 0.0, {}};
  if (arguments.has("--ids")) {
    auto ids = ids_in_use(arguments.all("--ids"), markers.family);
    if (!ids) return base::fail(std::move(ids));
    markers.options.ids = *std::move(ids);
  }
  const auto thickness = arguments.number("--thickness-mm");
  if (!thickness) return tl::unexpected(thickness.error());
  const auto diameter = arguments.number("--dot-diameter-mm");
  if (!diameter) return tl::unexpected(diameter.error());
  if (thickness->value_or(0.0) < 0.0 || diameter->value_or(1.0) <= 0.0)
    return base::fail(ErrorCode::kUsage, "--thickness-mm is 0 or more, --dot-diameter-mm more than 0");
  markers.thickness_mm = thickness->value_or(0.0);
  markers.dot_diameter_mm = *diameter;
  task.markers = std::move(markers);
  return {};
}

Result<Outcome> scan_folders(const Arguments& arguments, Session& session) {
  if (arguments.has("--station")) return base::fail(ErrorCode::kUsage, "--station goes with a JOB");
  for (const char* option : {"--rig", "--left", "--right", "--manifest", "--out"}) {
    if (!arguments.has(option)) return base::fail(ErrorCode::kUsage, fmt::format("without a JOB scan needs {}", option));
  }
  ScanTask task;
  task.head = *arguments.get("--rig");
  task.left = *arguments.get("--left");
  task.right = *arguments.get("--right");
  task.manifest = *arguments.get("--manifest");
  task.base_folder = std::filesystem::current_path();
  if (auto read = read_options(arguments, session, task); !read) return base::fail(std::move(read));
  if (auto read = read_markers(arguments, task); !read) return base::fail(std::move(read));
  const auto step = scan_step(task, *arguments.get("--out"), session);
  if (!step) return tl::unexpected(step.error());
  session.say("scan    " + step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

Result<Outcome> scan_job(const Arguments& arguments, Session& session) {
  for (const char* option :
       {"--rig", "--left", "--right", "--manifest", "--family", "--ids", "--thickness-mm", "--dot-diameter-mm"}) {
    if (arguments.has(option))
      return base::fail(ErrorCode::kUsage, fmt::format("{} goes without a JOB; a job says it in its job.toml", option));
  }
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const std::filesystem::path results = job->folder / "results";
  const auto out = arguments.get("--out");
  auto scans = station_scans(*job, "", arguments.get("--station"), out ? std::filesystem::path(*out) : results / "scan");
  if (!scans) return base::fail(std::move(scans));
  const auto head = scan_head(*job, results, session);
  if (!head) return tl::unexpected(head.error());
  for (StationScan& scan : *scans) {
    scan.task.head = head->string();
    if (auto read = read_options(arguments, session, scan.task); !read) return base::fail(std::move(read));
  }
  const auto tell = [&](const std::string& what, const StepOutcome& step) {
    session.say(fmt::format("{}  {}", what, step.summary));
    session.print((step.folder / "result.json").string());
  };
  auto ended = scan_stations(*scans, tell, session);
  return out ? ended : with_index(*job, std::move(ended));
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  return arguments.has("JOB") ? scan_job(arguments, session) : scan_folders(arguments, session);
}

}  // namespace

Verb scan_verb() {
  return {"scan",
          "make a cloud with a sigma for each point from the fringe images of two calibrated cameras",
          "  $ crosstie scan --rig job/results/calibrate --left x0850/left --right x0850/right \\\n"
          "      --manifest patterns/patterns.json --out x0850/cloud\n"
          "  scan    1838994 points, median sigma 0.0777 mm\n"
          "  x0850/cloud/result.json",
          {{"JOB", "JOB", "job folder or its job.toml, with [[station]] scan = { left, right, manifest }; or the options below",
            false, false},
           {"--station", "NAME", "of a JOB: this station alone", false, false},
           {"--rig", "RIG",
            "folder of a calibrate or commission result, or INTRINSIC.yml,EXTRINSIC.yml of OpenCV's stereo calibration (mm)",
            false, false},
           {"--left", "DIR", "folder of the left camera's images", false, false},
           {"--right", "DIR", "folder of the right camera's images", false, false},
           {"--manifest", "FILE", "which image shows what: patterns.json as patterns writes it", false, false},
           {"--out", "DIR",
            "folder for cloud.ply, depth.tiff, edge_pixels.csv and report; replaced as a whole (of a JOB: for a folder of each "
            "station, default "
            "JOB/results/scan)",
            false, false},
           {"--family", "FAMILY", "markers on the wall, such as ring10: they are measured, and the points on them left out",
            false, false, 1, markers::marker_family_names()},
           {"--ids", "IDS", "ids of the markers in use, such as 0-127 (default: all of the family)", false, true},
           {"--thickness-mm", "MM", "from the wall to the plane of the markers' dots (default 0)", false, false},
           {"--dot-diameter-mm", "MM", "of the markers' dots (default: as their images show it)", false, false},
           {"--min-depth-mm", "MM", "nearest depth that is taken (default 0)", false, false},
           {"--max-depth-mm", "MM", "farthest depth that is taken", false, false},
           {"--guard-px", "PX", "pixels nearer than this to the end of a surface are left out (default 2)", false, false},
           {"--filter-px", "PX",
            "average depths over squares of 2 n + 1 pixels; the result states the correlation length (default 0: none)", false,
            false},
           {"--max-grazing-deg", "DEG", "largest angle between normal and viewing ray (default 70)", false, false},
           {"--max-phase-sigma-rad", "RAD", "largest sigma of a phase that is taken (default 0.2)", false, false},
           {"--max-movement-px", "PX",
            "movement from the first to the last image from which on a scan is refused (default 0.1; 0: never)", false, false},
           {"--max-light-change", "PERCENT",
            "change of the light meanwhile from which on it is refused, of the projector's light (default 10; 0: never)", false,
            false},
           {"--max-off-curve-px", "PX",
            "distance from the epipolar curves from which on the calibration is refused (default 0.25, of a calibration "
            "without covariance 1; "
            "0: never)",
            false, false},
           {"--noise-read", "LEVELS2", "variance of a grey level without light, where the images cannot tell it (three steps)",
            false, false},
           {"--noise-shot", "LEVELS", "growth of that variance with the level", false, false},
           {"--guard-creases", "",
            "leave out creases, such as between the face and the cut of a hole; rough surfaces lose points", false, false},
           {"--pcd", "", "write cloud.pcd, too", false, false},
           {"--covariance", "", "write six covariances a point into cloud.ply", false, false}},
          run};
}

}  // namespace crosstie::app
