// coordinates and reference -> deviations

#include <algorithm>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/point_covariance.h"
#include "app/result_folder.h"
#include "app/steps.h"
#include "app/verdicts.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/surface_document.h"
#include "report/surface_report.h"
#include "report/tables.h"
#include "report/verification_report.h"
#include "verify/compare.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

constexpr const char* kAdjustInput = "results/adjust/result.json";

bool is_result(const fs::path& path) { return path.extension() == ".json"; }

Result<base::PointList> measured_points(const fs::path& path) {
  return is_result(path) ? base::points_from_network_json(path) : base::read_point_list(path);
}

Result<verify::CompareOptions> compare_options(const VerificationTask& task) {
  verify::CompareOptions options;
  if (task.fit == "similarity") {
    options.fit = verify::Fit::kSimilarity;
  } else if (task.fit == "none") {
    options.fit = verify::Fit::kNone;
  } else if (task.fit != "rigid") {
    return base::fail(ErrorCode::kUsage, fmt::format("--fit is rigid, similarity or none, not '{}'", task.fit));
  }
  options.mpe.a_mm = task.limits.length_mpe_a_mm.value_or(options.mpe.a_mm);
  options.mpe.k = task.limits.length_mpe_k.value_or(options.mpe.k);
  options.defining_lengths = task.not_tested;
  return options;
}

ordered_json effective_options(const VerificationTask& task, const verify::CompareOptions& options) {
  ordered_json json = {{"fit", task.fit}, {"length_mpe_a_mm", options.mpe.a_mm}, {"length_mpe_k", options.mpe.k}};
  json["defining_lengths"] = ordered_json::array();
  for (const auto& [a, b] : options.defining_lengths) json["defining_lengths"].push_back({a, b});
  if (task.limits.deviation_rms_mm) json["deviation_rms_mm"] = *task.limits.deviation_rms_mm;
  if (task.limits.deviation_max_mm) json["deviation_max_mm"] = *task.limits.deviation_max_mm;
  return json;
}

Result<base::Verification> compare_points(const VerificationTask& task, verify::CompareOptions options) {
  const auto measured = measured_points(task.measured);
  if (!measured) return tl::unexpected(measured.error());
  const auto reference = base::read_point_list(task.reference, {task.reference_unit});
  if (!reference) return tl::unexpected(reference.error());
  if (is_result(task.measured)) {
    auto covariance = point_covariance(task.measured, measured->points.size());
    if (!covariance) return base::fail(std::move(covariance));
    options.measured_cov_mm2 = std::move(*covariance);
  }
  auto verification = verify::compare(*measured, *reference, options);
  if (!verification) {
    return base::fail(verification.error().code, fmt::format("{} against {}: {}", task.measured.string(),
                                                             task.reference.string(), verification.error().message));
  }
  return verification;
}

std::string points_summary(const base::Verification& verification) {
  const auto used =
      std::count_if(verification.points.begin(), verification.points.end(), [](const auto& point) { return point.used; });
  const base::PositionComparison& uncoded = verification.by_position;
  std::string of_uncoded;
  if (const std::size_t all = uncoded.points.size() + uncoded.unpaired.size(); all > 0) {
    of_uncoded = fmt::format("; {} of {} uncoded have a partner", uncoded.points.size(), all);
  }
  if (!uncoded.points.empty()) {
    of_uncoded += fmt::format(", RMS {:.4f} {:.4f} {:.4f} mm, max {:.4f} mm", uncoded.rms_mm.x(), uncoded.rms_mm.y(),
                              uncoded.rms_mm.z(), uncoded.max_mm);
  }
  return fmt::format("{} points, RMS {:.4f} {:.4f} {:.4f} mm (x y z), deviation over predicted sigma {:.2f}{}", used,
                     verification.rms_mm.x(), verification.rms_mm.y(), verification.rms_mm.z(), verification.normalised_rms,
                     of_uncoded);
}

std::string surfaces_summary(const base::SurfaceVerification& verification) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : "; ") + part; };
  if (verification.surface) {
    const base::SurfaceDeviations& s = *verification.surface;
    add(fmt::format("{} points against a {}: mean {:.3f} mm, scatter {:.3f} mm, {:.1f} % within {} mm", s.count, s.reference,
                    s.mean_mm, s.sigma_mm, 100.0 * s.in_tolerance, s.tolerance_mm));
  }
  if (verification.shape) {
    add(fmt::format("{}: diameter {:.3f} +- {:.3f} mm", verification.shape->shape, verification.shape->diameter_mm,
                    verification.shape->diameter_sigma_mm));
  }
  if (verification.edge) {
    add(fmt::format("rim: RMS {:.3f} mm, 95 % within {:.3f} mm, max {:.3f} mm", verification.edge->rms_mm,
                    verification.edge->p95_mm, verification.edge->max_mm));
  }
  return text;
}

}  // namespace

Result<VerificationTask> verification_task(const Job& job, const fs::path& results) {
  VerificationTask task;
  auto surface = surface_task(job, results / "stitch", results / "edge");
  if (!surface) return base::fail(std::move(surface));
  task.surface = *std::move(surface);
  task.base_folder = job.folder;
  task.title = job.name;
  task.limits = job.limits;
  if (job.network && job.reference_points) {
    task.measured = results / "adjust" / "result.json";
    task.reference = job.resolve(*job.reference_points);
    task.reference_unit = job.reference_unit;
    if (job.network->scale_from) task.not_tested.push_back(*job.network->scale_from);
  }
  if (!task.has_points() && !task.surface) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: the job has neither [reference] points of a [network] nor a stitched "
                                  "cloud with a surface to verify against",
                                  job.file.string()));
  }
  return task;
}

Result<StepOutcome> verify_step(const VerificationTask& task, const fs::path& out, Session& session) {
  auto options = compare_options(task);
  if (!options) return base::fail(std::move(options));
  ordered_json options_json = task.has_points() ? effective_options(task, *options) : ordered_json::object();
  if (task.surface) options_json["surface"] = surface_options(*task.surface);

  std::vector<base::ResultInput> inputs;
  std::vector<fs::path> files = task.surface ? surface_files(*task.surface) : std::vector<fs::path>{};
  if (task.has_points()) files.insert(files.end(), {task.measured, task.reference});
  for (const fs::path& file : files) {
    auto input = hashed_input(file, task.base_folder);
    if (!input) return base::fail(std::move(input));
    if (file == task.measured && is_result(file))
      input->path = kAdjustInput;  // by its place in the job, wherever --out puts it
    inputs.push_back(std::move(*input));
  }
  const ordered_json earlier = earlier_result(out, options_json);
  if (same_inputs(earlier, inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  std::optional<base::Verification> points;
  if (task.has_points()) {
    auto compared = compare_points(task, *std::move(options));
    if (!compared) return base::fail(std::move(compared));
    points = *std::move(compared);
  }
  std::optional<base::SurfaceVerification> surfaces;
  if (task.surface) {
    auto compared = compare_surfaces(*task.surface, session);
    if (!compared) return base::fail(std::move(compared));
    surfaces = *std::move(compared);
  }
  session.progress()("verify", 1, 1);

  base::ResultEnvelope envelope{"verify", "reference", inputs, {}, {}};
  ordered_json body = ordered_json::object();
  std::string summary;
  if (points) {
    envelope.verdicts = judge(*points, task.limits);
    envelope.warnings = points->warnings;
    body = base::verification_json(*points);
    summary = points_summary(*points);
    if (auto written = report::write_verification_tables(folder->path(), *points); !written)
      return base::fail(std::move(written));
  }
  if (surfaces) {
    for (base::Verdict& verdict : judge(*surfaces, task.limits)) envelope.verdicts.push_back(std::move(verdict));
    envelope.warnings.insert(envelope.warnings.end(), surfaces->warnings.begin(), surfaces->warnings.end());
    body.update(base::surface_verification_json(*surfaces));
    summary += (summary.empty() ? "" : "; ") + surfaces_summary(*surfaces);
    if (auto written = report::write_surface_tables(folder->path(), *surfaces); !written) return base::fail(std::move(written));
  }
  const report::ReportContext context{surfaces ? "Verification" : "Verification against reference points", task.title, envelope,
                                      options_json.dump(2), overview_of(out, session)};
  const std::string html = surfaces ? report::surface_report(*surfaces, context, points ? &*points : nullptr)
                                    : report::verification_report(*points, context);
  const ordered_json result = base::result_json(envelope, options_json, body);
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out, summary, false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
