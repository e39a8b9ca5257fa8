#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;

constexpr double kDegrees = 57.295779513082323;
constexpr double kLargeW = 3.29;  // 0.1 % two-sided

std::string role_text(base::ScaleBarRole role) {
  return role == base::ScaleBarRole::kUsed ? "used" : role == base::ScaleBarRole::kCheck ? "check" : "defines the scale";
}

std::string mounts_table(const base::AdjustedRig& rig) {
  std::vector<double> sigmas_mm;
  std::vector<double> sigmas_mrad;
  for (const base::AdjustedMount& mount : rig.mounts) {
    const Eigen::Matrix3d position = base::position_covariance(mount.rig_from_camera, mount.cov);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      sigmas_mm.push_back(std::sqrt(std::max(0.0, position(axis, axis))));
      sigmas_mrad.push_back(1e3 * std::sqrt(std::max(0.0, mount.cov(axis, axis))));
    }
  }
  const int decimals = decimals_for_column(sigmas_mm, 4);
  const int angle_decimals = decimals_for_column(sigmas_mrad, 4);
  HtmlTable table(
      fmt::format("Rig {}: where each camera sits, in the frame of the first. Rotation as the vector of its axis, as long as "
                  "its angle; sigmas of rotation about the rig's axes. U is twice the sigma.",
                  rig.name),
      {{"Camera", "", "", false},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"rx", "\u00b0"},
       {"ry", "\u00b0"},
       {"rz", "\u00b0"},
       {"s rx", "mrad"},
       {"s ry", "mrad"},
       {"s rz", "mrad"}});
  for (std::size_t m = 0; m < rig.mounts.size(); ++m) {
    const base::AdjustedMount& mount = rig.mounts[m];
    std::vector<Cell> row = {text_cell(mount.camera)};
    const auto add = [&](double value, int digits) { row.push_back(number_cell(fixed(value, digits), value)); };
    const bool leads = mount.cov.isZero(0.0);
    for (Eigen::Index axis = 0; axis < 3; ++axis) add(mount.rig_from_camera.translation_mm(axis), decimals);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (leads) row.push_back(text_cell("\u2013"));
      if (!leads) add(sigmas_mm[3 * m + axis], decimals);
    }
    const Eigen::Vector3d turn = kDegrees * base::rotation_log(mount.rig_from_camera.rotation);
    for (Eigen::Index axis = 0; axis < 3; ++axis) add(turn(axis), 5);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (leads) row.push_back(text_cell("\u2013"));
      if (!leads) add(sigmas_mrad[3 * m + axis], angle_decimals);
    }
    table.add_row(std::move(row));
  }
  return table.html();
}

}  // namespace

std::string bundle_scale_section(const AdjustedNetwork& network) {
  if (network.scale_bars.empty()) return paragraph(fmt::format("No scale bar; the scale is: {}.", network.scale));
  std::vector<double> sigmas;
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    if (bar.bar.role != base::ScaleBarRole::kDefines) sigmas.push_back(bar.sigma_mm);  // one that defines has none but rounding
  }
  const int decimals = decimals_for_column(sigmas, 4);
  HtmlTable table(
      "Known distances at the temperature of the photographs. Check bars tell nothing to the adjustment. w is the "
      "deviation over its own sigma, that of the bar included.",
      {{"Bar", "", "", false},
       {"Role", "", "", false},
       {"Nominal", "mm", "at 20 \u00b0C"},
       {"T", "\u00b0C", "temperature of the bar"},
       {"Known", "mm", "at its temperature"},
       {"s known", "mm", "standard uncertainty of the known length"},
       {"Measured", "mm"},
       {"s measured", "mm"},
       {"U", "mm", "expanded uncertainty of the measured length, k = 2"},
       {"Deviation", "mm"},
       {"Relative", "ppm"},
       {"w", ""},
       {"Certificate", "", "", false}});
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    const double known = bar.bar.length_at_temperature_mm();
    const double deviation = bar.measured_mm - known;
    table.add_row({text_cell(fmt::format("{}\u2013{}", bar.bar.id_a, bar.bar.id_b)), text_cell(role_text(bar.bar.role)),
                   number_cell(fixed(bar.bar.length_mm, decimals), bar.bar.length_mm),
                   number_cell(fixed(bar.bar.temperature_c, 1), bar.bar.temperature_c),
                   number_cell(fixed(known, decimals), known), number_cell(fixed(bar.bar.sigma_mm, decimals), bar.bar.sigma_mm),
                   number_cell(fixed(bar.measured_mm, decimals), bar.measured_mm),
                   number_cell(fixed(bar.sigma_mm, decimals), bar.sigma_mm),
                   number_cell(fixed(2.0 * bar.sigma_mm, decimals), 2.0 * bar.sigma_mm),
                   number_cell(fixed(deviation, decimals), deviation),
                   number_cell(fixed(known > 0.0 ? 1e6 * deviation / known : 0.0, 1), deviation / known),
                   number_cell(fixed(bar.w, 2), bar.w, std::abs(bar.w) > kLargeW ? "warning" : ""),
                   text_cell(bar.bar.certificate)});
  }
  return table.html();
}

std::string bundle_rigs_section(const AdjustedNetwork& network) {
  std::string html;
  for (const base::AdjustedRig& rig : network.rigs) {
    const double sigma = rig.baseline_sigma_mm();
    html += fmt::format("<h3>Rig {}</h3>\n", escape(rig.name));
    if (rig.mounts.size() > 1) {
      html += definition_list({{"Baseline", with_sigma(rig.baseline_mm(), sigma, "mm")},
                               {"Expanded (k = 2)", expanded(sigma, "mm")},
                               {"Stations", std::to_string(rig.stations)}});
    }
    html += mounts_table(rig);
  }
  return html;
}

std::string bundle_control_section(const AdjustedNetwork& network) {
  std::vector<double> residuals_mm;
  for (const base::AdjustedControl& one : network.control) residuals_mm.push_back(one.residual_mm.cwiseAbs().maxCoeff());
  const int decimals = decimals_for_column(residuals_mm, 4);
  HtmlTable table(
      "Control points: adjusted minus given coordinates, with the sigma that was given (0: held). w is the standardised "
      "residual "
      "of the group that the point belongs to.",
      {{"Id", ""},
       {"dx", "mm"},
       {"dy", "mm"},
       {"dz", "mm"},
       {"Given sx", "mm"},
       {"Given sy", "mm"},
       {"Given sz", "mm"},
       {"w", ""}});
  table.limit_rows(1000, "control.csv");
  for (const base::AdjustedControl& one : network.control) {
    std::vector<Cell> row = {number_cell(std::to_string(one.id), one.id)};
    for (const Eigen::Vector3d& triple : {one.residual_mm, one.sigma_mm}) {
      for (const double value : triple) row.push_back(number_cell(fixed(value, decimals), value));
    }
    row.push_back(number_cell(fixed(one.w, 2), one.w, one.w > kLargeW ? "warning" : ""));
    table.add_row(std::move(row));
  }
  return table.html();
}

}  // namespace crosstie::report::detail
