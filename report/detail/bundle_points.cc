#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/charts.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;
using base::AdjustedPoint;

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr std::size_t kMaxRows = 3000;
constexpr int kFewRays = 3;  // below: nothing tells a blunder from a point
constexpr double kFlatAngle_rad = 20.0 / kDegrees;
constexpr double kLargeW = 3.29;        // 0.1 % two-sided
constexpr double kUncontrolled = 0.05;  // redundancy number

}  // namespace

std::vector<PlanPoint> plan_points(const AdjustedNetwork& network) {
  std::vector<PlanPoint> points;
  for (const AdjustedPoint& point : network.points) {
    const Eigen::Vector3d sigma = point.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt();
    points.push_back({point.id, point.xyz_mm, point.cov_mm2, Eigen::Vector3d::Zero(),
                      fmt::format("point {}: sigma x {}, y {}, z {} mm", point.id, significant(sigma.x(), 2),
                                  significant(sigma.y(), 2), significant(sigma.z(), 2)),
                      point.kind != "coded"});
  }
  return points;
}

double ellipse_magnification(const AdjustedNetwork& network) {
  std::vector<double> sigmas;
  for (const AdjustedPoint& point : network.points) sigmas.push_back(largest_sigma(point.cov_mm2));
  return plan_magnification(plan_points(network), median(sigmas));
}

std::string bundle_plan_section(const AdjustedNetwork& network) {
  const std::vector<PlanPoint> points = plan_points(network);
  const double magnification = ellipse_magnification(network);
  const bool any_hollow = std::any_of(points.begin(), points.end(), [](const PlanPoint& point) { return point.hollow; });
  const char* rings = any_hollow ? " Rings: targets without a code." : "";
  std::vector<std::string> list;
  for (const auto& [horizontal, vertical] : plan_axes(points)) {
    const std::string name = fmt::format("{}{}", "xyz"[horizontal], "xyz"[vertical]);
    list.push_back(figure(plan_view(points, fmt::format("Plan view {}", name),
                                    {.horizontal = horizontal, .vertical = vertical, .magnification = magnification}),
                          fmt::format("Points in {} with their one-sigma error ellipses, magnified {} times.{}", name,
                                      significant(magnification, 2), rings)));
  }
  std::vector<int> rays;
  std::vector<int> angles;
  for (const AdjustedPoint& point : network.points) {
    rays.push_back(point.rays);
    if (std::isfinite(point.angle_rad)) angles.push_back(static_cast<int>(std::lround(point.angle_rad * kDegrees)));
  }
  list.push_back(figure(count_bars(rays, "Rays per point", "rays", "points"),
                        "How many images determine each point. Fewer than 3 rays cannot be checked against a blunder."));
  list.push_back(figure(count_bars(angles, "Intersection angles", "largest angle between two rays [\u00b0]", "points"),
                        "Below about 20\u00b0 the depth of a point is weak."));
  return figures(list);
}

namespace {

/// Coordinates and how well they are known.
std::string coordinates_table(const AdjustedNetwork& network) {
  std::vector<double> sigmas_mm;
  for (const AdjustedPoint& point : network.points) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) sigmas_mm.push_back(std::sqrt(std::max(0.0, point.cov_mm2(axis, axis))));
  }
  const int decimals = decimals_for_column(sigmas_mm, 4);
  const LengthUnit unit = unit_for_lengths(sigmas_mm);
  for (double& sigma : sigmas_mm) sigma *= unit.per_mm;
  const int sigma_decimals = decimals_for_column(sigmas_mm, 4);
  HtmlTable table(
      "Adjusted coordinates in the network's frame, standard deviations s, expanded uncertainties U = 2 s (k = 2), and the "
      "semi-axes of the one-sigma ellipsoid. The full covariances stand in points.csv.",
      {{"Id", ""},
       {"Kind", "", "", false},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"sx", unit.name},
       {"sy", unit.name},
       {"sz", unit.name},
       {"Ux", unit.name, "k = 2"},
       {"Uy", unit.name, "k = 2"},
       {"Uz", unit.name, "k = 2"},
       {"a", unit.name, "longest semi-axis of the ellipsoid"},
       {"b", unit.name},
       {"c", unit.name, "shortest semi-axis of the ellipsoid"}});
  table.limit_rows(kMaxRows, "points.csv");
  for (const AdjustedPoint& point : network.points) {
    std::vector<Cell> row = {number_cell(std::to_string(point.id), point.id), text_cell(point.kind)};
    const auto add = [&](double value) { row.push_back(number_cell(fixed(value, sigma_decimals), value)); };
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      row.push_back(number_cell(fixed(point.xyz_mm(axis), decimals), point.xyz_mm(axis)));
    const Eigen::Vector3d sigma = point.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt() * unit.per_mm;
    for (const double one : sigma) add(one);
    for (const double one : sigma) add(2.0 * one);
    const Eigen::Matrix3d axes = ellipsoid_axes(point.cov_mm2) * unit.per_mm;  // ascending
    for (Eigen::Index k = 2; k >= 0; --k) add(axes.col(k).norm());
    table.add_row(std::move(row), fmt::format("p-{}", point.id));
  }
  return table.html();
}

/// What determines and controls them.
std::string control_table(const AdjustedNetwork& network) {
  std::vector<double> rms_px;
  for (const AdjustedPoint& point : network.points) rms_px.push_back(point.rms_px);
  const int decimals = decimals_for_column(rms_px, 3);
  HtmlTable table(
      fmt::format("What determines each point and how well its image points control each other. Marked: fewer than {} rays, "
                  "angles below 20\u00b0, w above {}, redundancy below {}: a blunder there would hardly show.",
                  kFewRays, kLargeW, kUncontrolled),
      {{"Id", ""},
       {"Kind", "", "", false},
       {"Rays", ""},
       {"Angle", "\u00b0", "largest angle between two rays"},
       {"rms", "px", "sqrt(sum of squared residuals / rays)"},
       {"max", "px", "its longest residual"},
       {"max w", "", "largest standardised residual of its image points"},
       {"Redundancy", "", "least redundancy number of its image coordinates: 0 uncontrolled, 1 fully controlled"}});
  table.limit_rows(kMaxRows, "points.csv");
  for (const AdjustedPoint& point : network.points) {
    table.add_row(
        {number_cell(std::to_string(point.id), point.id), text_cell(point.kind),
         number_cell(std::to_string(point.rays), point.rays, point.rays < kFewRays ? "warning" : ""),
         number_cell(fixed(point.angle_rad * kDegrees, 1), point.angle_rad, point.angle_rad < kFlatAngle_rad ? "warning" : ""),
         number_cell(fixed(point.rms_px, decimals), point.rms_px), number_cell(fixed(point.max_px, decimals), point.max_px),
         number_cell(fixed(point.max_w, 2), point.max_w, point.max_w > kLargeW ? "warning" : ""),
         number_cell(fixed(point.least_redundancy, 3), point.least_redundancy,
                     point.least_redundancy < kUncontrolled ? "warning" : "")});
  }
  return table.html();
}

}  // namespace

std::string bundle_points_section(const AdjustedNetwork& network) {
  if (network.points.empty()) return paragraph("There is no adjusted point.");
  return coordinates_table(network) + control_table(network);
}

}  // namespace crosstie::report::detail
