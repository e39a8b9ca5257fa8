#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/edge_pixels.h"
#include "report/context.h"

namespace crosstie::report {

/// What the page shows beside the curve; lists have one entry for each of its points, or are empty.
struct EdgeView {
  base::EdgeCurve curve;
  std::string nominal;                               ///< "circle, diameter 62.15 mm, sigma 0.02 mm"; empty: none was fitted
  std::vector<double> off_u_mm;                      ///< from the nominal, in the surface across the rim
  std::vector<double> off_v_mm;                      ///< along the normal
  std::array<std::vector<double>, 2> camera_off_mm;  ///< of each camera from both together; not a number: it saw nothing
  std::optional<double> rms_u_mm;
  std::optional<double> rms_v_mm;
  double roughness_factor = 1.0;
  std::vector<std::pair<std::string, std::int64_t>> fates;  ///< of the edge pixels
  std::array<base::EdgePixels, 2> edges;                    ///< those shown over the image
  std::array<std::vector<Eigen::Vector2d>, 2> curve_px;     ///< the curve in both images
  std::array<double, 4> region_px = {};                     ///< of the left image; the right one is shown about the curve
};

/// One HTML page on a hole's edge: its length and gaps, its hair diagram (deviations from the nominal along the arc), sigmas along the arc,
/// how the cameras agree, the edge pixels of both images with the curve. The same input gives the same bytes.
std::string edge_report(const EdgeView& view, const ReportContext& context);

}  // namespace crosstie::report
