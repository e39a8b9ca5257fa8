#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
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
constexpr double kLargeW = 3.29;  // 0.1 % two-sided

}  // namespace

std::vector<PlanPoint> plan_points(const AdjustedNetwork& network) {
  std::vector<PlanPoint> points;
  for (const AdjustedPoint& point : network.points) {
    const Eigen::Vector3d sigma = point.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt();
    points.push_back({point.id, point.xyz_mm, point.cov_mm2, Eigen::Vector3d::Zero(),
                      fmt::format("point {}: sigma x {}, y {}, z {} mm", point.id, significant(sigma.x(), 2),
                                  significant(sigma.y(), 2), significant(sigma.z(), 2))});
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
  std::vector<std::string> list;
  for (const auto& [horizontal, vertical] : plan_axes(points)) {
    const std::string name = fmt::format("{}{}", "xyz"[horizontal], "xyz"[vertical]);
    list.push_back(figure(plan_view(points, fmt::format("Plan view {}", name),
                                    {.horizontal = horizontal, .vertical = vertical, .magnification = magnification}),
                          fmt::format("Points in {} with their one-sigma error ellipses, magnified {} times.", name,
                                      significant(magnification, 2))));
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

std::string bundle_points_section(const AdjustedNetwork& network) {
  if (network.points.empty()) return paragraph("There is no adjusted point.");
  std::vector<double> sigmas_mm;
  std::vector<double> rms_px;
  for (const AdjustedPoint& point : network.points) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) sigmas_mm.push_back(std::sqrt(std::max(0.0, point.cov_mm2(axis, axis))));
    rms_px.push_back(point.rms_px);
  }
  const int decimals = decimals_for_column(sigmas_mm, 4);
  const LengthUnit unit = unit_for_lengths(sigmas_mm);
  for (double& sigma : sigmas_mm) sigma *= unit.per_mm;
  const int sigma_decimals = decimals_for_column(sigmas_mm, 4);
  const int px_decimals = decimals_for_column(rms_px, 3);
  HtmlTable table(
      fmt::format("Adjusted coordinates in the network's frame with standard deviations. U is twice the standard deviation in "
                  "the worst direction (k = 2). Marked: fewer than {} rays, angles below 20\u00b0, w above {}.",
                  kFewRays, kLargeW),
      {{"Id", ""},
       {"Kind", "", "", false},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"sx", unit.name},
       {"sy", unit.name},
       {"sz", unit.name},
       {"U", unit.name, "expanded uncertainty in the worst direction, k = 2"},
       {"Rays", ""},
       {"Angle", "\u00b0", "largest angle between two rays"},
       {"rms", "px", "sqrt(sum of squared residuals / rays)"},
       {"max w", "", "largest standardised residual of its image points"}});
  table.limit_rows(kMaxRows, "points.csv");
  for (const AdjustedPoint& point : network.points) {
    std::vector<Cell> row = {number_cell(std::to_string(point.id), point.id), text_cell(point.kind)};
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      row.push_back(number_cell(fixed(point.xyz_mm(axis), decimals), point.xyz_mm(axis)));
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double sigma = std::sqrt(std::max(0.0, point.cov_mm2(axis, axis))) * unit.per_mm;
      row.push_back(number_cell(fixed(sigma, sigma_decimals), sigma));
    }
    const double u = 2.0 * largest_sigma(point.cov_mm2) * unit.per_mm;
    row.push_back(number_cell(fixed(u, sigma_decimals), u));
    row.push_back(number_cell(std::to_string(point.rays), point.rays, point.rays < kFewRays ? "warning" : ""));
    row.push_back(
        number_cell(fixed(point.angle_rad * kDegrees, 1), point.angle_rad, point.angle_rad < kFlatAngle_rad ? "warning" : ""));
    row.push_back(number_cell(fixed(point.rms_px, px_decimals), point.rms_px));
    row.push_back(number_cell(fixed(point.max_w, 2), point.max_w, point.max_w > kLargeW ? "warning" : ""));
    table.add_row(std::move(row), fmt::format("p-{}", point.id));
  }
  return table.html();
}

std::string bundle_images_section(const AdjustedNetwork& network) {
  if (network.images.empty()) return paragraph("There is no adjusted image.");
  std::map<int, std::pair<Eigen::Vector2d, Eigen::Vector2d>> boxes;
  for (const base::AdjustedObservation& one : network.residuals) {
    const auto [at, fresh] = boxes.try_emplace(one.image, one.measured_px, one.measured_px);
    at->second.first = at->second.first.cwiseMin(one.measured_px);
    at->second.second = at->second.second.cwiseMax(one.measured_px);
  }
  std::vector<double> sigmas_mm;
  std::vector<double> angles_mrad;
  std::vector<double> rms_px;
  for (const base::AdjustedImage& image : network.images) {
    sigmas_mm.push_back(largest_sigma(base::position_covariance(image.network_from_camera, image.cov)));
    angles_mrad.push_back(1e3 * largest_sigma(image.cov.topLeftCorner<3, 3>()));
    rms_px.push_back(image.rms_px);
  }
  const int decimals = decimals_for_column(sigmas_mm, 3);
  const int angle_decimals = decimals_for_column(angles_mrad, 4);
  const int px_decimals = decimals_for_column(rms_px, 3);
  HtmlTable table(
      "Projection centres in the network's frame. Sigmas are those of the worst direction, of position and of rotation; "
      "covered is the share of the image inside the rectangle round its points.",
      {{"Image", "", "", false},
       {"Camera", "", "", false},
       {"Points", ""},
       {"Covered", "%"},
       {"rms", "px"},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"Sigma position", "mm"},
       {"U", "mm", "k = 2"},
       {"Sigma rotation", "mrad"}});
  table.limit_rows(kMaxRows, "images.csv");
  for (std::size_t i = 0; i < network.images.size(); ++i) {
    const base::AdjustedImage& image = network.images[i];
    double covered = 0.0;
    const auto box = boxes.find(static_cast<int>(i));
    const auto camera =
        std::find_if(network.cameras.begin(), network.cameras.end(), [&](const auto& c) { return c.name == image.camera; });
    if (box != boxes.end() && camera != network.cameras.end()) {
      const Eigen::Vector2d size = box->second.second - box->second.first;
      covered = 100.0 * size.x() * size.y() / (static_cast<double>(camera->camera.width_px()) * camera->camera.height_px());
    }
    const Eigen::Vector3d& centre = image.network_from_camera.translation_mm;
    table.add_row({text_cell(image.name), text_cell(image.camera), number_cell(std::to_string(image.rays), image.rays),
                   number_cell(fixed(covered, 0), covered), number_cell(fixed(image.rms_px, px_decimals), image.rms_px),
                   number_cell(fixed(centre.x(), decimals), centre.x()), number_cell(fixed(centre.y(), decimals), centre.y()),
                   number_cell(fixed(centre.z(), decimals), centre.z()),
                   number_cell(fixed(sigmas_mm[i], decimals), sigmas_mm[i]),
                   number_cell(fixed(2.0 * sigmas_mm[i], decimals), sigmas_mm[i]),
                   number_cell(fixed(angles_mrad[i], angle_decimals), angles_mrad[i])});
  }
  return table.html();
}

}  // namespace crosstie::report::detail
