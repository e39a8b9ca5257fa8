#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "app/steps.h"
#include "base/phase_map.h"
#include "scan/cloud.h"
#include "scan/decode.h"
#include "scan/match.h"

namespace crosstie::app {

/// One station's fringe images and what makes a cloud of them.
struct ScanTask {
  std::string head;  ///< see read_head()
  std::filesystem::path left;
  std::filesystem::path right;
  std::filesystem::path manifest;
  scan::DecodeOptions decode;
  scan::MatchOptions match;
  scan::CloudOptions cloud;
  bool write_covariance = false;  ///< the cloud's file gets six covariances a point
  std::filesystem::path base_folder;
  std::string title;
};

/// fringe images of two cameras -> cloud in the rig's frame.
base::Result<StepOutcome> scan_step(const ScanTask& task, const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
