#include <cmath>

#include <fmt/format.h>

#include "report/detail/charts.h"
#include "report/detail/commissioning_sections.h"
#include "report/detail/html.h"
#include "report/detail/image_plots.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::Commissioning;

constexpr double kLargeW = 3.29;  // 0.1 % two-sided

std::string stations_table(const Commissioning& result) {
  HtmlTable table(
      "How far each stop is from the axis: along it (what the reading did not say), across it, and in its turn. w is the "
      "standardised "
      "deviation of the whole stop.",
      {{"Station", "", "", false},
       {"Reading", "mm"},
       {"Along", "\u00b5m"},
       {"Across", "\u00b5m"},
       {"Turn", "\u00b5rad"},
       {"w", ""}});
  for (const base::CommissionedStation& station : result.stations) {
    const Eigen::Vector3d turn = station.off_axis.head<3>();
    const Eigen::Vector3d shift = station.off_axis.tail<3>() + turn.cross(station.machine_from_rig.translation_mm);
    const double across = std::sqrt(std::max(0.0, shift.squaredNorm() - station.off_along_mm * station.off_along_mm));
    table.add_row({text_cell(station.name), number_cell(plain(station.axis_mm, 7), station.axis_mm),
                   number_cell(fixed(1e3 * station.off_along_mm, 1), station.off_along_mm),
                   number_cell(fixed(1e3 * across, 1), across), number_cell(fixed(1e6 * turn.norm(), 1), turn.norm()),
                   number_cell(fixed(station.w, 2), station.w, std::abs(station.w) > kLargeW ? "warning" : "")});
  }
  return table.html();
}

std::string images_table(const Commissioning& result) {
  HtmlTable table("Residuals of each image: adjusted minus measured.", {{"Image", "", "", false},
                                                                        {"Camera", "", "", false},
                                                                        {"Station", "", "", false},
                                                                        {"Points", ""},
                                                                        {"rms", "px"},
                                                                        {"Largest", "px"}});
  for (const base::CommissionedImage& image : result.images) {
    table.add_row({text_cell(image.name), text_cell(image.camera),
                   text_cell(result.stations.at(static_cast<std::size_t>(image.station)).name),
                   number_cell(std::to_string(image.rays), image.rays), number_cell(significant(image.rms_px, 3), image.rms_px),
                   number_cell(significant(image.max_px, 3), image.max_px)});
  }
  return table.html();
}

}  // namespace

std::string commissioning_images_section(const CommissioningView& view) {
  const Commissioning& result = view.result;
  std::vector<std::string> plots;
  std::vector<double> normalised;
  for (const auto& [name, camera] :
       {std::pair(&result.head.left_name, &result.head.left), std::pair(&result.head.right_name, &result.head.right)}) {
    std::vector<ImagePoint> points;
    for (const base::CommissionedRay& ray : result.residuals) {
      const base::CommissionedImage& image = result.images.at(static_cast<std::size_t>(ray.image));
      if (image.camera != *name) continue;
      points.push_back({ray.measured_px, ray.residual_px,
                        fmt::format("{} marker {}: {} px", image.name, ray.id, significant(ray.residual_px.norm(), 2))});
      for (Eigen::Index i = 0; i < 2; ++i) {
        if (ray.sigma_px(i) > 0.0) normalised.push_back(ray.residual_px(i) / ray.sigma_px(i));
      }
    }
    if (points.empty()) continue;
    const ImageSize size{camera->width_px(), camera->height_px()};
    plots.push_back(figure(residual_vectors(points, size, fmt::format("Residuals of {}", *name)),
                           fmt::format("All stations of camera {}.", *name)));
    plots.push_back(figure(coverage_map(points, size, fmt::format("Coverage of {}", *name)),
                           "Where the cross was in the image; elsewhere the lens rests on its calibration."));
  }
  if (!normalised.empty()) {
    plots.push_back(figure(histogram(normalised, "Residuals over their sigmas", "residual / sigma", {{1.0, "normal, sigma 1"}}),
                           "Both coordinates of all image points, with the sigmas they were weighted by."));
  }
  return stations_table(result) + images_table(result) + figures(plots);
}

}  // namespace crosstie::report::detail
