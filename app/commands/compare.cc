// crosstie compare: two models of one camera

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/lens_word.h"
#include "app/steps_compare.h"
#include "app/verb.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;

/// The names given by --camera belong to those of A and B that hold several cameras, in order; one serves both.
Result<std::pair<ChosenCamera, ChosenCamera>> choose_cameras(const Arguments& arguments) {
  const std::vector<std::string> names = arguments.all("--camera");
  const std::vector<fs::path> paths = {*arguments.get("A"), *arguments.get("B")};
  std::vector<ChosenCamera> chosen;
  std::size_t holders = 0;
  for (const fs::path& path : paths) {
    std::string name;
    if (holds_cameras(path)) {
      if (!names.empty()) name = names[std::min(holders, names.size() - 1)];
      ++holders;
    }
    auto camera = choose_camera(path, name);
    if (!camera) return fail(std::move(camera));
    chosen.push_back(*std::move(camera));
  }
  if (names.size() > holders) {
    return fail(ErrorCode::kUsage,
                fmt::format("--camera chooses in the folder of a result or in a chain of cameras: {} given, {} of "
                            "A and B hold{} several",
                            names.size(), holders, holders == 1 ? "s" : ""));
  }
  return std::pair{std::move(chosen[0]), std::move(chosen[1])};
}

Result<math::ProjectionDifferenceOptions> read_options(const Arguments& arguments) {
  math::ProjectionDifferenceOptions options;
  for (const auto& [name, value] : {std::pair{"--distance-mm", &options.distance_mm}, {"--radius-px", &options.radius_px}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    if (!*number) continue;
    if (!(**number > 0.0)) return fail(ErrorCode::kUsage, fmt::format("{} must be positive", name));
    *value = **number;
  }
  const auto columns = arguments.integer("--columns");
  if (!columns) return tl::unexpected(columns.error());
  if (*columns) options.columns = static_cast<int>(std::clamp(**columns, -1L, 1'000'000L));
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  return options;
}

std::string described(const base::NamedModel& model) {
  return fmt::format("{}: {}, {} x {} px, {} covariance", model.name, lens_word(model.camera.model()), model.camera.width_px(),
                     model.camera.height_px(), model.camera.covariance().size() > 0 ? "with" : "without");
}

void print(const base::ModelComparison& comparison, Session& session) {
  const base::ProjectionDifference& difference = comparison.difference;
  session.print("A  " + described(comparison.a));
  session.print("B  " + described(comparison.b));
  session.print(fmt::format("{:<24} {:>16} {:>16} {:>16}", "difference [px]", "after the motion", "without it", "predicted"));
  const auto row = [&](const std::string& name, double after, double before, double sigma) {
    session.print(fmt::format("{:<24} {:>16.4f} {:>16.4f} {:>16}", name, after, before,
                              std::isfinite(sigma) ? fmt::format("{:.4f}", sigma) : "-"));
  };
  row("rms", difference.rms_px, difference.rms_before_px, difference.test ? difference.test->rms_sigma_px : std::nan(""));
  for (const base::DifferenceQuantile& one : base::quantiles(difference)) {
    row(one.share < 1.0 ? fmt::format("{:.0f} % of the cells below", 100.0 * one.share) : std::string("largest"), one.after_px,
        one.before_px, one.sigma_px);
  }
  constexpr double kDegrees = 57.295779513082323;
  const Eigen::Vector3d turn = kDegrees * base::rotation_log(difference.b_from_a.rotation);
  std::string motion = fmt::format("implied motion: turn {:.5f} {:.5f} {:.5f} degrees", turn.x(), turn.y(), turn.z());
  if (difference.distance_mm > 0.0) {
    const Eigen::Vector3d& shift = difference.b_from_a.translation_mm;
    motion +=
        fmt::format(", shift {:.4f} {:.4f} {:.4f} mm, at {:g} mm", shift.x(), shift.y(), shift.z(), difference.distance_mm);
  } else {
    motion += ", at infinity";
  }
  session.print(motion);
  if (!difference.test) {
    session.print("no prediction: a model comes without covariance");
    return;
  }
  session.print(fmt::format("{} the covariances of both predict: rms over prediction {:.2f}, p {:.2g}",
                            difference.test->exceeded() ? "MORE than" : "no more than",
                            difference.rms_px / difference.test->rms_sigma_px, difference.test->p));
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto options = read_options(arguments);
  if (!options) return tl::unexpected(options.error());
  auto cameras = choose_cameras(arguments);
  if (!cameras) return fail(std::move(cameras));
  const ComparisonTask task{std::move(cameras->first), std::move(cameras->second), *options, fs::current_path()};
  const auto comparison = compare_models(task);
  if (!comparison) return tl::unexpected(comparison.error());
  if (const auto out = arguments.get("--out")) {
    if (const auto written = write_comparison(task, *comparison, *out); !written) return written;
    session.say((fs::path(*out) / "result.json").string());
  }
  print(*comparison, session);
  return outcome_of(*comparison);
}

}  // namespace

Verb compare_verb() {
  return {
      "compare",
      "compare two models of one camera by where they project, after the motion of the camera's frame that hides most of it",
      "  $ crosstie compare monday/left.cameramodel tuesday/results/calibrate --camera left --distance-mm 1300 --out change\n"
      "",
      {{"A", "A", "camera model: .cameramodel, YAML of OpenCV or kalibr, or the folder of a result with camera models", true,
        false},
       {"B", "B", "another model of the same camera", true, false},
       {"--camera", "NAME", "which camera of a result's folder or a chain of kalibr; given twice: of A, then of B", false,
        true},
       {"--distance-mm", "MM", "compare points at this distance, with a shift of the frame (default: at infinity, a turn only)",
        false, false},
       {"--radius-px", "PX", "only cells within this radius of the image's middle decide (default: all calibrated ones)", false,
        false},
       {"--columns", "N", "cells in a row of the grid, 4 to 400 (default 40)", false, false},
       {"--out", "DIR", "folder for result.json, report.html and difference.csv; replaced as a whole", false, false}},
      run};
}

}  // namespace crosstie::app
