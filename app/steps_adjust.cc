// observations -> coordinates

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/adjust_result.h"
#include "app/current.h"
#include "app/lens_word.h"
#include "app/network_input.h"
#include "app/steps.h"
#include "bundle/adjust.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

/// All of the job that the adjustment depends on, apart from files.
ordered_json effective_options(const Job& job, const bundle::AdjustOptions& options) {
  ordered_json json = {
      {"significance", options.significance}, {"min_angle_rad", options.min_angle_rad}, {"uncoded", options.uncoded}};
  json["cameras"] = ordered_json::object();
  for (const auto& [name, camera] : job.cameras) {
    ordered_json& entry = json["cameras"][name];
    entry = {{"lens", lens_word(camera.lens.value_or(base::LensModel::kOpenCv5))}, {"estimate", camera.estimate}};
    if (camera.model) entry["model"] = camera.model->generic_string();
    if (camera.focal_px) entry["focal_px"] = *camera.focal_px;
    if (camera.focal_mm) entry["focal_mm"] = *camera.focal_mm;
    if (camera.sensor_width_mm) entry["sensor_width_mm"] = *camera.sensor_width_mm;
    if (!camera.fixed.empty()) entry["fixed"] = camera.fixed;
    if (!camera.sigmas.empty()) entry["sigmas"] = camera.sigmas;
  }
  json["variance_components"] = job.network->apply_components ? "apply" : "tell";
  if (job.network->scale_from) json["scale_from"] = {job.network->scale_from->first, job.network->scale_from->second};
  json["scale_is_free"] = job.network->scale_is_free;
  if (job.rig) json["rig"] = {{"name", job.rig->name}, {"cameras", job.rig->cameras}};
  if (job.network->control) json["control"] = job.network->control->generic_string();
  if (job.network->datum) json["datum"] = job.network->datum->generic_string();
  if (job.dot_diameter_mm) json["dot_diameter_mm"] = *job.dot_diameter_mm;
  json["limits"] = {
      {"sigma0_px", job.limits.sigma0_px}, {"scale_bar_w", job.limits.scale_bar_w}, {"control_w", job.limits.control_w}};
  if (job.limits.point_sigma_mm) json["limits"]["point_sigma_mm"] = *job.limits.point_sigma_mm;
  return json;
}

}  // namespace

Result<> check_scale(const Job& job) {
  if (!job.network || job.network->scale_bars || job.network->scale_from || job.network->scale_is_free || job.network->control)
    return {};
  return base::fail(
      ErrorCode::kNoUniqueSolution,
      fmt::format(
          "{}: nothing gives the network its scale: add scale_bars, scale_from or control to [network], or scale = \"free\" "
          "for coordinates in an arbitrary unit",
          job.file.string()));
}

Result<StepOutcome> adjust_step(const Job& job, const fs::path& detection, const fs::path& out, Session& session) {
  bundle::AdjustOptions adjust_options;
  adjust_options.uncoded = job.network->uncoded;
  if (job.network->apply_components) adjust_options.variance_components = bundle::VarianceComponents::kApply;
  const ordered_json options = effective_options(job, adjust_options);
  auto inputs = network_inputs(job, detection);
  if (!inputs) return base::fail(std::move(inputs));
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const auto network = network_of(job, detection);
  if (!network) return tl::unexpected(network.error());
  const auto adjusted = bundle::adjust(*network, adjust_options, session.progress());
  if (!adjusted) return tl::unexpected(adjusted.error());
  return write_adjustment(*folder, out, *adjusted,
                          {job.name, std::move(*inputs), options, job.limits, overview_of(out, session)});
}

}  // namespace crosstie::app
