#pragma once

#include <array>
#include <string>
#include <vector>

#include "app/steps_scan.h"
#include "base/edge_pixels.h"
#include "base/machine.h"
#include "base/observation.h"
#include "base/scan_summary.h"

namespace crosstie::app {

/// What the steps of a scan gave.
struct ScanParts {
  std::array<base::PhaseMap, 2> maps;
  scan::DepthMap depths;
  scan::ScanCloud cloud;  ///< without the points on markers
  base::HeadTest head_test;
  std::array<base::ImageObservations, 2> observations;
  std::int64_t on_markers = 0;
  std::vector<base::ScannedMarker> markers;
  std::vector<base::EdgePixels> edges;  ///< left, right
};

base::ScanSummary summarise(const ScanTask& task, const base::Head& head, const ScanParts& parts);

/// A field of a cloud by its name, null where it has none of it.
const std::vector<double>* cloud_field(const base::Cloud& cloud, const std::string& name);

}  // namespace crosstie::app
