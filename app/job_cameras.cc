// [camera.NAME] and [rig]

#include <algorithm>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/job_sections.h"
#include "app/lens_word.h"

namespace crosstie::app {
namespace {

JobCamera read_camera(const JobTable& table, const std::string& name) {
  table.check_keys("camera", {"board_images", "temperature_c", "model", "focal_mm", "sensor_width_mm", "focal_px", "lens",
                              "estimate", "white_level", "fixed", "sigmas"});
  JobCamera camera;
  if (table.has("board_images")) table.text("board_images", camera.board_images.emplace());
  table.number("temperature_c", camera.temperature_c, Domain::kAny);
  table.path("model", camera.model);
  table.number("focal_mm", camera.focal_mm);
  table.number("sensor_width_mm", camera.sensor_width_mm);
  table.number("focal_px", camera.focal_px);
  table.number("white_level", camera.white_level);
  table.flag("estimate", camera.estimate);
  table.texts("fixed", camera.fixed);
  if (const auto sigmas = table.table("sigmas")) {
    for (const std::string& parameter : sigmas->keys()) {
      std::optional<double> sigma;
      sigmas->number(parameter, sigma, Domain::kAny);
      if (sigma && *sigma < 0.0) sigmas->complain(parameter, fmt::format("the sigma of {} must be 0 or larger", parameter));
      if (sigma) camera.sigmas[parameter] = *sigma;
    }
  }
  std::string lens;
  table.text("lens", lens);
  if (!lens.empty()) {
    camera.lens = lens_from_word(lens);
    if (!camera.lens)
      table.complain("lens", fmt::format("lens must be one of {}, not '{}'", fmt::join(lens_words(), ", "), lens));
  }
  if (camera.focal_mm.has_value() != camera.sensor_width_mm.has_value()) {
    table.complain("", fmt::format("[camera.{}] needs focal_mm and sensor_width_mm together", name));
  }
  if (!camera.estimate && !camera.model && !camera.board_images) {
    table.complain("", fmt::format("[camera.{}] estimate = false needs a model whose parameters are to be taken", name));
  }
  if (camera.model && camera.board_images) {
    table.complain("board_images", fmt::format("[camera.{}] has a model already: give model or board_images, not both", name));
  }
  return camera;
}

}  // namespace

void read_cameras(const JobTable& root, Job& job) {
  const auto cameras = root.table("camera");
  if (!cameras) return;
  for (const std::string& name : cameras->keys()) {
    if (const auto table = cameras->table(name)) job.cameras.emplace(name, read_camera(*table, name));
  }
}

void read_rig(const JobTable& root, Job& job) {
  const auto table = root.table("rig");
  if (!table) return;
  table->check_keys("rig", {"name", "cameras", "baseline_mm"});
  JobRig rig;
  table->text("name", rig.name);
  table->texts("cameras", rig.cameras);
  table->number("baseline_mm", rig.baseline_mm);
  if (rig.cameras.size() < 2) table->complain("", "[rig] needs cameras = [\"LEFT\", \"RIGHT\"], two or more");
  std::vector<std::string> sorted = rig.cameras;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
    table->complain("cameras", "[rig] names a camera twice");
  job.rig = std::move(rig);
}

}  // namespace crosstie::app
