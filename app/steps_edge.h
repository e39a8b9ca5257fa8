#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "app/steps.h"
#include "edge/hole_edge.h"
#include "edge/nominal.h"

namespace crosstie::app {

/// One station's scan and the hole that is looked for in it.
struct EdgeTask {
  std::filesystem::path scan;      ///< folder of a scan's result
  std::string head;                ///< see read_head(); empty: the one that the scan says it was made with
  std::string nominal = "circle";  ///< circle, ellipse, oval or a file with the nominal's points
  edge::HoleEdgeOptions options;
  std::filesystem::path base_folder;
  std::string title;
};

/// edge pixels and depths of a scan -> the hole's edge in the rig's frame, with the nominal fitted to it.
base::Result<StepOutcome> edge_step(const EdgeTask& task, const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
