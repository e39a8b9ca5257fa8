// [network]

#include <algorithm>

#include "app/job_sections.h"

namespace crosstie::app {

void read_network(const JobTable& root, Job& job) {
  const auto table = root.table("network");
  if (!table) return;
  table->check_keys("network",
                    {"images", "scale_bars", "scale_from", "scale", "control", "datum", "uncoded", "variance_components"});
  JobNetwork network;
  const auto images = table->table("images");
  const std::vector<std::string> cameras = images ? images->keys() : std::vector<std::string>{};
  if (cameras.empty()) return table->complain("images", "[network] needs images = { CAMERA = \"pattern\" }");
  for (const std::string& camera : cameras) {
    images->text(camera, network.images.emplace_back(camera, "").second);
    job.cameras.try_emplace(camera);
  }
  table->path("scale_bars", network.scale_bars);
  table->pair("scale_from", network.scale_from);
  if (network.scale_from && network.scale_from->first == network.scale_from->second) {
    table->complain("scale_from", "scale_from must be two different ids");
  }
  std::string scale;
  table->word("scale", {"free"}, scale);
  network.scale_is_free = scale == "free";
  table->path("control", network.control);
  table->path("datum", network.datum);
  if (network.control && network.datum) {
    table->complain("datum", "control points define the frame already: give datum or control, not both");
  }
  table->flag("uncoded", network.uncoded);
  std::string components;
  table->word("variance_components", {"tell", "apply"}, components);
  network.apply_components = components == "apply";
  job.network = std::move(network);
}

}  // namespace crosstie::app
