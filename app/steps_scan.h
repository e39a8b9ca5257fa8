#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "app/steps.h"
#include "base/machine.h"
#include "markers/detect.h"
#include "markers/family.h"
#include "scan/cloud.h"
#include "scan/decode.h"
#include "scan/edge_pixels.h"
#include "scan/match.h"

namespace crosstie::app {

/// The markers on the scanned wall.
struct ScanMarkers {
  markers::MarkerFamily family;
  markers::DetectOptions options;
  double thickness_mm = 0.0;              ///< from the wall to the plane of the dots
  std::optional<double> dot_diameter_mm;  ///< nothing: as it is seen
};

/// One station's fringe images and what makes a cloud of them.
struct ScanTask {
  std::string head;     ///< see read_head()
  std::string station;  ///< observations are of the images STATION/left and STATION/right; empty: left and right
  std::filesystem::path left;
  std::filesystem::path right;
  std::filesystem::path manifest;
  scan::DecodeOptions decode;
  scan::MatchOptions match;
  scan::CloudOptions cloud;
  scan::EdgeOptions edges;
  std::optional<ScanMarkers> markers;                      ///< nothing: there are none, or nobody wants them
  std::array<std::optional<double>, 2> white_levels = {};  ///< of saturated pixels, where not the file format's
  /// [px] What images of the same may lie off the epipolar curves before the calibration is refused; 0: any. Nothing: see
  /// off_curve_limit_px().
  std::optional<double> max_off_curve_px;
  bool write_pcd = false;         ///< cloud.pcd beside cloud.ply
  bool write_covariance = false;  ///< the cloud's file gets six covariances a point
  std::filesystem::path base_folder;
  std::string title;
};

/// The task's limit. Default: 0.25 for a head with a covariance, which keeps within a few hundredths, or a tenth when it has warmed up;
/// 1 where nothing says how good the calibration is.
[[nodiscard]] double off_curve_limit_px(const ScanTask& task, const base::Head& head);

/// fringe images of two cameras -> cloud in the rig's frame.
base::Result<StepOutcome> scan_step(const ScanTask& task, const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
