#include <cmath>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/charts.h"
#include "report/detail/html.h"
#include "report/detail/image_plots.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;
using base::AdjustedObservation;

/// Below this redundancy number a residual is hidden by the unknowns and its normalised value is noise.
constexpr double kLeastRedundancy = 0.05;

struct CameraResiduals {
  std::vector<ImagePoint> points;
  std::vector<double> radius_px;   ///< of each normalised value
  std::vector<double> normalised;  ///< v / (sigma sqrt(r)), x and y
};

CameraResiduals residuals_of(const AdjustedNetwork& network, const base::AdjustedCamera& camera) {
  CameraResiduals result;
  const Eigen::Vector2d middle(0.5 * (camera.camera.width_px() - 1), 0.5 * (camera.camera.height_px() - 1));
  for (const AdjustedObservation& one : network.residuals) {
    const auto image = static_cast<std::size_t>(one.image);
    const auto point = static_cast<std::size_t>(one.point);
    if (image >= network.images.size() || network.images[image].camera != camera.name) continue;
    const std::string id = point < network.points.size() ? std::to_string(network.points[point].id) : "?";
    result.points.push_back({one.measured_px, one.residual_px, fmt::format("{} in {}", id, network.images[image].name)});
    for (int axis = 0; axis < 2; ++axis) {
      if (!(one.redundancy(axis) > kLeastRedundancy) || !(one.sigma_px(axis) > 0.0)) continue;
      result.normalised.push_back(one.residual_px(axis) / (one.sigma_px(axis) * std::sqrt(one.redundancy(axis))));
      result.radius_px.push_back((one.measured_px - middle).norm());
    }
  }
  return result;
}

}  // namespace

std::string bundle_residuals_section(const AdjustedNetwork& network) {
  if (network.residuals.empty()) return paragraph("There are no residuals.");
  std::string html;
  std::vector<double> normalised;
  for (const base::AdjustedCamera& camera : network.cameras) {
    const CameraResiduals one = residuals_of(network, camera);
    normalised.insert(normalised.end(), one.normalised.begin(), one.normalised.end());
    const ImageSize size{camera.camera.width_px(), camera.camera.height_px()};
    html +=
        fmt::format("<h3>Camera {}</h3>\n", escape(camera.name)) +
        figures({figure(residual_vectors(one.points, size, fmt::format("Residuals of camera {}", camera.name)),
                        "Residuals of all images, adjusted minus measured. They should show no pattern."),
                 figure(residual_field(one.points, size, fmt::format("Mean residuals of camera {}", camera.name)),
                        "Mean residual of each part of the image: what the lens model leaves behind."),
                 figure(coverage_map(one.points, size, fmt::format("Coverage of camera {}", camera.name)),
                        fmt::format("{} % of the image's parts hold points; where none are, the lens model is extrapolated.",
                                    fixed(100.0 * coverage(one.points, size), 0))),
                 figure(rms_along(one.radius_px, one.normalised, 1.0, "Normalised residuals by distance from the image centre",
                                  "distance from the image centre [px]", "rms of residual over sigma"),
                        "Level where the lens model holds out to the corners. Bars: 95 % range of each class.")});
  }
  html += "<h3>Are the predicted sigmas true?</h3>\n";
  html += figures(
      {figure(
           histogram(normalised, "Standardised residuals w", "w = residual over its own sigma",
                     {{1.0, "as predicted"}, {network.sigma0, fmt::format("with sigma0 = {}", significant(network.sigma0))}}),
           "w of each image coordinate: its residual over the sigma that the detector's sigma and the network's geometry "
           "predict for "
           "it."),
       figure(normal_quantile_plot(normalised, "Normal quantiles of the normalised residuals", "residual over its own sigma"),
              "On the line: normal and as large as predicted. Bent ends: blunders or heavy tails.")});
  return html;
}

}  // namespace crosstie::report::detail
