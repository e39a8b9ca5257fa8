#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/edge_pixels.h"
#include "base/pose.h"
#include "base/tool_path.h"
#include "report/context.h"

namespace crosstie::report {

/// An image with the curve and the edge pixels near it.
struct EdgeImage {
  std::string name;  ///< "left", or with its station "x0850, left"
  std::vector<base::EdgePixel> pixels;
  std::vector<Eigen::Vector2d> curve_px;
};

/// Where the workpiece lies.
struct EdgePart {
  std::string source;  ///< what holds it: "markers", "rps", "tower", "none"
  base::Pose machine_from_part;
  base::Matrix6d cov = base::Matrix6d::Zero();
  std::optional<double> sigma0;  ///< of the points that hold it; nothing: none are redundant
};

/// What the page shows beside the curve; lists have one entry for each of its points, or are empty.
struct EdgeView {
  base::EdgeCurve curve;
  std::string nominal;                               ///< "circle, diameter 62.15 mm, sigma 0.02 mm"; empty: none was fitted
  std::vector<double> off_u_mm;                      ///< from the nominal, in the surface across the rim
  std::vector<double> off_v_mm;                      ///< along the normal
  bool off_from_placed = false;                      ///< from the nominal where the part lies; false: as fitted to the rim
  std::array<std::vector<double>, 2> camera_off_mm;  ///< of each camera from both together; not a number: it saw nothing
  std::optional<double> rms_u_mm;                    ///< from the fitted nominal
  std::optional<double> rms_v_mm;
  double roughness_factor = 1.0;
  std::vector<std::pair<std::string, std::int64_t>> fates;  ///< of the edge pixels
  std::vector<EdgeImage> images;
  std::optional<EdgePart> part;
  std::optional<base::ToolPath> path;
};

/// One HTML page on a hole's edge: its length and gaps, its hair diagram (deviations from the nominal along the arc), sigmas along the arc,
/// how the cameras agree, where the part lies, the torch's path with its corrections, the edge pixels of all images with the curve. The same input gives the same bytes.
std::string edge_report(const EdgeView& view, const ReportContext& context);

}  // namespace crosstie::report
