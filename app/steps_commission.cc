// cross photographs, calibration, probed spheres -> the head in the machine's frame

#include "app/steps_commission.h"

#include <cmath>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/certificates.h"
#include "app/commissioning_view.h"
#include "app/current.h"
#include "app/result_folder.h"
#include "app/verdicts.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "bundle/commission.h"
#include "report/commissioning_report.h"
#include "report/commissioning_tables.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::ordered_json;

/// All of the job that the commissioning depends on, apart from files.
ordered_json effective_options(const Job& job, const bundle::CommissionOptions& options) {
  const JobCross& cross = *job.cross;
  const JobMachine& machine = *job.machine;
  ordered_json json = {{"significance", options.significance},
                       {"rejection_significance", options.rejection_significance},
                       {"estimate_image_sigma", options.estimate_image_sigma},
                       {"tolerance_px", options.tolerance_px}};
  json["cross"] = {{"points", cross.points ? cross.points->generic_string() : "adjust"},
                   {"points_temperature_c", cross.points_temperature_c.value_or(20.0)},
                   {"temperature_c", cross.thermal.temperature_c},
                   {"temperature_sigma_c", cross.thermal.temperature_sigma_c},
                   {"cte_per_k", cross.thermal.cte_per_k},
                   {"cte_sigma_per_k", cross.thermal.cte_sigma_per_k},
                   {"certificate", cross.certificate.number}};
  json["machine"] = {{"certificate", machine.certificate.number}};
  if (machine.stylus_diameter_mm) json["machine"]["stylus_diameter_mm"] = *machine.stylus_diameter_mm;
  if (machine.probe_sigma_mm) json["machine"]["probe_sigma_mm"] = *machine.probe_sigma_mm;
  if (machine.axis_sigma_mm) json["machine"]["axis_sigma_mm"] = *machine.axis_sigma_mm;
  json["stations"] = ordered_json::array();
  for (const JobStation& station : job.stations)
    json["stations"].push_back({{"name", station.name}, {"axis_mm", station.axis_mm}});
  if (job.date) json["date"] = base::format_date(*job.date);
  json["limits"] = {
      {"sigma0_px", job.limits.sigma0_px}, {"sphere_w", job.limits.sphere_w}, {"rig_change_w", job.limits.rig_change_w}};
  if (job.limits.frame_u_mm) json["limits"]["frame_u_mm"] = *job.limits.frame_u_mm;
  return json;
}

std::string summary(const base::Commissioning& result) {
  const base::LinearAxis& axis = result.frame.axis;
  std::string motions;
  for (const base::ErrorMotion& term : axis.terms) {
    if (term.significant && motions.find(term.name) == std::string::npos) motions += (motions.empty() ? "" : " ") + term.name;
  }
  const double direction_rad = std::sqrt(std::max(0.0, axis.direction_cov.trace() / 2.0));
  return fmt::format(
      "{} stations from {:g} to {:g} mm, direction +- {:.3f} mrad, scale {:.0f} +- {:.0f} ppm, {}, FRE {:.3f} mm, sigma0 "
      "{:.4f} px, {} "
      "rejected, {} warnings",
      result.stations.size(), axis.from_mm, axis.to_mm, 1e3 * direction_rad, axis.scale_ppm, axis.scale_sigma_ppm,
      motions.empty() ? "no error motions" : motions, result.fre_mm, result.sigma0_px, result.rejected.size(),
      result.warnings.size());
}

}  // namespace

Result<StepOutcome> commission_step(const Job& job, const CommissionSources& sources, const fs::path& out, Session& session) {
  const bundle::CommissionOptions commission_options;
  const ordered_json options = effective_options(job, commission_options);
  auto inputs = commission_inputs(job, sources);
  if (!inputs) return base::fail(std::move(inputs));
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) return StepOutcome{out, "up to date", true, outcome_of(earlier)};

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  std::vector<base::Warning> warnings;
  const auto input = commission_input(job, sources, warnings);
  if (!input) return tl::unexpected(input.error());
  auto result = bundle::commission(*input, commission_options, session.progress());
  if (!result) return base::fail(result.error().code, fmt::format("{}: {}", job.file.string(), result.error().message));
  check_certificate(job.cross->certificate, "the cross", job.date, warnings);
  check_certificate(job.machine->certificate, "the machine's spheres", job.date, warnings);
  result->warnings.insert(result->warnings.end(), warnings.begin(), warnings.end());

  const base::ResultEnvelope envelope{"commission", "machine", std::move(*inputs), judge(*result, input->head, job.limits),
                                      result->warnings};
  if (auto written = report::write_commissioning_tables(folder->path(), *result); !written)
    return base::fail(std::move(written));
  if (auto written = base::write_covariance(folder->path(), {result->covariance, result->labels}); !written)
    return base::fail(std::move(written));
  const std::string html = report::commissioning_report(
      commissioning_view(*result, *input),
      {"The head in the machine's frame", job.name, envelope, options.dump(2), overview_of(out, session)});
  const ordered_json json = base::result_json(envelope, options, base::commissioning_json(*result));
  if (auto published = publish(*folder, html, json); !published) return base::fail(std::move(published));
  return StepOutcome{out, summary(*result), false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
