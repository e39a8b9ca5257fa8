// an AICON project -> coordinates

#include <nlohmann/json.hpp>

#include "app/adjust_result.h"
#include "app/current.h"
#include "app/steps.h"
#include "bundle/adjust.h"

namespace crosstie::app {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::ordered_json;

Result<StepOutcome> adjust_aicon_step(const AiconTask& task, const fs::path& out, Session& session) {
  const auto project = base::find_aicon_project(task.folder);
  if (!project) return tl::unexpected(project.error());
  base::AiconNetworkOptions reading = task.reading;
  std::vector<fs::path> files = {project->image_points, project->object_points, project->cameras, project->images,
                                 project->scales};
  if (task.sigmas) {
    auto sigmas = base::read_image_point_sigmas(*task.sigmas);
    if (!sigmas) return base::fail(std::move(sigmas));
    reading.overrides = std::move(*sigmas);
    files.push_back(*task.sigmas);
  }
  if (task.excluded) {
    auto excluded = base::read_image_point_ids(*task.excluded);
    if (!excluded) return base::fail(std::move(excluded));
    reading.excluded = std::move(*excluded);
    files.push_back(*task.excluded);
  }
  auto inputs = hashed_inputs(files, task.folder);
  if (!inputs) return base::fail(std::move(inputs));

  auto network = base::read_aicon_network(*project, reading);
  if (!network) return base::fail(std::move(network));
  for (base::NetworkCamera& camera : network->cameras) camera.held = task.held;
  // AICON's weights are those of the observations, and its rays take part as they are.
  const bundle::AdjustOptions how{
      .model_sigma_px = 0.0,
      .reject_outliers = task.reject_outliers,
      .variance_components = task.apply_components ? bundle::VarianceComponents::kApply : bundle::VarianceComponents::kTell,
      .min_angle_rad = 0.0};
  ordered_json options = {{"sigma_mm", reading.sigma_mm}};
  if (reading.sigma_px > 0.0) options = {{"sigma_px", reading.sigma_px}};
  options["fixed"] = task.held;
  options["reject_outliers"] = task.reject_outliers;
  options["variance_components"] = task.apply_components ? "apply" : "tell";
  options["start_values"] = reading.start_values;

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const auto adjusted = bundle::adjust(*network, how, session.progress());
  if (!adjusted) return tl::unexpected(adjusted.error());
  const std::string title = project->image_points.stem().string();
  return write_adjustment(*folder, out, *adjusted, {title, *std::move(inputs), options, {}, overview_of(out, session)});
}

}  // namespace crosstie::app
