#include <cmath>

#include <fmt/format.h>

#include "report/detail/calibration_sections.h"
#include "report/detail/charts.h"
#include "report/detail/html.h"
#include "report/detail/image_plots.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {

std::string calibration_residuals_section(const base::Calibration& calibration) {
  std::string html;
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    const ImageSize size{camera.camera.width_px(), camera.camera.height_px()};
    const Eigen::Vector2d middle(0.5 * (size.width_px - 1), 0.5 * (size.height_px - 1));
    std::vector<ImagePoint> points;
    std::vector<double> radius_px;
    std::vector<double> coordinates_px;
    std::vector<double> standardised;
    for (const base::CalibrationResidual& one : calibration.residuals) {
      const base::CalibratedView& view = calibration.views.at(static_cast<std::size_t>(one.view));
      if (view.camera != camera.name) continue;
      points.push_back({one.measured_px, one.residual_px, fmt::format("corner {} in {}", one.corner, view.image)});
      for (int axis = 0; axis < 2; ++axis) {
        coordinates_px.push_back(one.residual_px(axis));
        radius_px.push_back((one.measured_px - middle).norm());
      }
    }
    if (points.empty()) continue;
    const double sigma_px = camera.rms_px / std::sqrt(2.0);
    for (const double value : coordinates_px) standardised.push_back(value / sigma_px);
    html +=
        fmt::format("<h3>Camera {}</h3>\n", escape(camera.name)) +
        figures(
            {figure(residual_vectors(points, size, fmt::format("Residuals of camera {}", camera.name)),
                    "Residuals of all images, adjusted minus measured. They should show no pattern."),
             figure(residual_field(points, size, fmt::format("Mean residuals of camera {}", camera.name)),
                    "Mean residual of each part of the image: what the lens model leaves behind."),
             figure(coverage_map(points, size, fmt::format("Coverage of camera {}", camera.name)),
                    fmt::format("Where corners were seen: {} % of the inner cells of a grid of 10 x 10, {} % of those of the "
                                "border. Elsewhere the lens model is extrapolated; later steps count that as not calibrated.",
                                fixed(100.0 * camera.area.inner_share(), 0), fixed(100.0 * camera.area.border_share(), 0))),
             figure(
                 histogram(coordinates_px, fmt::format("Residuals of camera {}", camera.name), "residual of a coordinate [px]",
                           {{sigma_px, fmt::format("normal, sigma {} px", significant(sigma_px))}}),
                 "Residuals of single coordinates with the normal distribution of the same spread. Heavy ends: blunders."),
             figure(rms_along(radius_px, coordinates_px, sigma_px, "Residuals by distance from the image centre",
                              "distance from the image centre [px]", "rms of a coordinate [px]"),
                    "Level where the lens model holds out to the corners. Bars: 95 % range of each class."),
             figure(normal_quantile_plot(standardised, fmt::format("Normal quantiles, camera {}", camera.name),
                                         "residual over its spread"),
                    "On the line: normal. Bent ends: blunders or heavy tails.")});
  }
  return html.empty() ? paragraph("There are no residuals.") : html;
}

}  // namespace crosstie::report::detail
