#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr std::size_t kMaxRows = 3000;

/// How well each image is covered and fits.
std::string fit_table(const AdjustedNetwork& network) {
  std::vector<double> rms_px;
  for (const base::AdjustedImage& image : network.images) rms_px.push_back(image.rms_px);
  const int decimals = decimals_for_column(rms_px, 3);
  HtmlTable table("Image points that took part; covered is the share of the image inside the upright rectangle round them.",
                  {{"Image", "", "", false},
                   {"Camera", "", "", false},
                   {"Points", ""},
                   {"Covered", "%"},
                   {"rms", "px", "sqrt(sum of squared residuals / points)"},
                   {"max", "px", "longest residual"}});
  table.limit_rows(kMaxRows, "images.csv");
  for (const base::AdjustedImage& image : network.images) {
    table.add_row({text_cell(image.name), text_cell(image.camera), number_cell(std::to_string(image.rays), image.rays),
                   number_cell(fixed(100.0 * image.coverage, 0), image.coverage),
                   number_cell(fixed(image.rms_px, decimals), image.rms_px),
                   number_cell(fixed(image.max_px, decimals), image.max_px)});
  }
  return table.html();
}

/// Where it was taken from.
std::string pose_table(const AdjustedNetwork& network) {
  std::vector<double> sigmas_mm;
  std::vector<double> angles_mrad;
  for (const base::AdjustedImage& image : network.images) {
    sigmas_mm.push_back(largest_sigma(base::position_covariance(image.network_from_camera, image.cov)));
    angles_mrad.push_back(1e3 * largest_sigma(image.cov.topLeftCorner<3, 3>()));
  }
  const int decimals = decimals_for_column(sigmas_mm, 3);
  const int angle_decimals = decimals_for_column(angles_mrad, 4);
  HtmlTable table(
      "Poses: projection centre and rotation (the vector of its axis, as long as its angle) of the camera in the network's "
      "frame. s is the standard deviation in the worst direction, U = 2 s (k = 2); those of each axis stand in images.csv.",
      {{"Image", "", "", false},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"s position", "mm"},
       {"U", "mm", "k = 2"},
       {"rx", "\u00b0"},
       {"ry", "\u00b0"},
       {"rz", "\u00b0"},
       {"s rotation", "mrad"},
       {"U", "mrad", "k = 2"}});
  table.limit_rows(kMaxRows, "images.csv");
  for (std::size_t i = 0; i < network.images.size(); ++i) {
    const base::AdjustedImage& image = network.images[i];
    std::vector<Cell> row = {text_cell(image.name)};
    const auto add = [&](double value, int digits) { row.push_back(number_cell(fixed(value, digits), value)); };
    for (const double one : image.network_from_camera.translation_mm) add(one, decimals);
    add(sigmas_mm[i], decimals);
    add(2.0 * sigmas_mm[i], decimals);
    const Eigen::Vector3d turn = kDegrees * base::rotation_log(image.network_from_camera.rotation);
    for (const double one : turn) add(one, 4);
    add(angles_mrad[i], angle_decimals);
    add(2.0 * angles_mrad[i], angle_decimals);
    table.add_row(std::move(row));
  }
  return table.html();
}

}  // namespace

std::string bundle_images_section(const AdjustedNetwork& network) {
  if (network.images.empty()) return paragraph("There is no adjusted image.");
  return fit_table(network) + pose_table(network);
}

}  // namespace crosstie::report::detail
