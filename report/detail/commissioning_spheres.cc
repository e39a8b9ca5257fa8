#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/commissioning_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plan_view.h"

namespace crosstie::report::detail {
namespace {

constexpr double kLargeW = 3.29;  // 0.1 % two-sided

std::string counting(const base::CommissionedSphere& sphere) {
  std::string text;
  for (std::size_t i = 0; i < 3; ++i) text += sphere.axes[i] ? std::string(1, "xyz"[i]) : std::string();
  return text;
}

std::string spheres_table(const base::Commissioning& result) {
  std::vector<double> sigmas;
  for (const base::CommissionedSphere& sphere : result.spheres) {
    for (const double sigma : sphere.sigma_mm) sigmas.push_back(sigma);
  }
  const int decimals = decimals_for_column(sigmas, 4);
  HtmlTable table(
      "Adjusted minus probed centres in machine, with the probing's sigma. Left out: where all the others put the sphere, "
      "minus where it "
      "was probed, with the sigma of that difference; it shows a sphere that is wrong but heavy enough to pull the frame to "
      "itself.",
      {{"Sphere", ""},
       {"Counts", "", "coordinates that tie the frame", false},
       {"dx", "mm"},
       {"dy", "mm"},
       {"dz", "mm"},
       {"3D", "mm"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"w", ""},
       {"left out dx", "mm"},
       {"dy", "mm"},
       {"dz", "mm"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"max d/s", ""}});
  for (const base::CommissionedSphere& sphere : result.spheres) {
    std::vector<Cell> row = {number_cell(std::to_string(sphere.id), sphere.id), text_cell(counting(sphere))};
    const auto add = [&](double value) { row.push_back(number_cell(fixed(value, decimals), value)); };
    for (const double value : sphere.residual_mm) add(value);
    add(sphere.residual_mm.norm());
    for (const double value : sphere.sigma_mm) add(value);
    row.push_back(number_cell(fixed(sphere.w, 2), sphere.w, std::abs(sphere.w) > kLargeW ? "warning" : ""));
    if (!sphere.left_out_mm) {
      for (int i = 0; i < 7; ++i) row.push_back(text_cell("\u2013"));
      table.add_row(std::move(row));
      continue;
    }
    double worst = 0.0;
    for (const double value : *sphere.left_out_mm) add(value);
    for (Eigen::Index i = 0; i < 3; ++i) {
      add(sphere.left_out_sigma_mm(i));
      if (sphere.left_out_sigma_mm(i) > 0.0) {
        worst = std::max(worst, std::abs((*sphere.left_out_mm)(i)) / sphere.left_out_sigma_mm(i));
      }
    }
    row.push_back(number_cell(fixed(worst, 2), worst, worst > kLargeW ? "warning" : ""));
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string spheres_plan(const base::Commissioning& result) {
  std::vector<PlanPoint> points;
  std::vector<double> lengths;
  for (const base::CommissionedSphere& sphere : result.spheres) {
    points.push_back({sphere.id, sphere.centre_mm, sphere.cov_mm2, sphere.residual_mm,
                      fmt::format("sphere {}: {} mm", sphere.id, significant(sphere.residual_mm.norm(), 2))});
    lengths.push_back(sphere.residual_mm.norm());
  }
  if (points.size() < 2) return "";
  const double magnification = plan_magnification(points, median(lengths));
  std::vector<std::string> views;
  for (const auto& [horizontal, vertical] : plan_axes(points)) {
    views.push_back(
        figure(plan_view(points, "Residuals of the spheres in machine",
                         {.horizontal = horizontal, .vertical = vertical, .arrows = true, .magnification = magnification}),
               "Arrows: adjusted minus probed. Ellipses: sigma of the adjusted centre."));
  }
  return figures(views);
}

}  // namespace

std::string commissioning_spheres_section(const CommissioningView& view) {
  const base::Commissioning& result = view.result;
  std::string html = definition_list({{"Datum", result.datum},
                                      {"FRE: rms length of the residuals", fmt::format("{} mm", significant(result.fre_mm, 3))},
                                      {"Scale between probed and listed spheres (a check)",
                                       with_sigma(result.sphere_scale_ppm, result.sphere_scale_sigma_ppm, "ppm")},
                                      {"Expanded (k = 2)", expanded(result.sphere_scale_sigma_ppm, "ppm")}});
  return html + spheres_table(result) + spheres_plan(result);
}

std::string commissioning_cross_section(const CommissioningView& view) {
  const base::Commissioning& result = view.result;
  const base::Cross& cross = view.cross;
  const Eigen::Vector3d at = result.machine_from_cross.translation_mm;
  const Eigen::Vector3d sigma =
      base::position_covariance(result.machine_from_cross, result.machine_from_cross_cov).diagonal().cwiseMax(0.0).cwiseSqrt();
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Coordinates refer to", fmt::format("{} \u00b0C", plain(cross.measured_at_c))},
      {"On the machine", with_sigma(cross.temperature_c, cross.temperature_sigma_c, "\u00b0C")},
      {"Expansion coefficient", fmt::format("({} \u00b1 {}) \u00b7 10\u207b\u2076 / K", plain(1e6 * cross.cte_per_k),
                                            plain(1e6 * cross.cte_sigma_per_k))},
      {"Growth, stated", with_sigma(result.growth_stated_ppm, result.growth_stated_sigma_ppm, "ppm")},
      {"Growth, adjusted", with_sigma(result.growth_ppm, result.growth_sigma_ppm, "ppm")},
      {"Expanded (k = 2)", expanded(result.growth_sigma_ppm, "ppm")}};
  for (Eigen::Index i = 0; i < 3; ++i) {
    facts.emplace_back(fmt::format("Origin of the cross in machine, {}", "xyz"[i]), with_sigma(at(i), sigma(i), "mm"));
  }
  const base::Certificate& certificate = cross.certificate;
  std::string about = certificate.number.empty() ? "none is stated" : certificate.number;
  if (certificate.issued) about += ", of " + base::format_date(*certificate.issued);
  if (certificate.valid_until) about += ", valid until " + base::format_date(*certificate.valid_until);
  facts.emplace_back("Certificate of the cross", about);

  std::vector<double> residuals;
  for (const base::CommissionedMarker& marker : result.markers) residuals.push_back(marker.sigma_mm.maxCoeff());
  const int decimals = decimals_for_column(residuals, 4);
  HtmlTable table("Markers of the cross: adjusted minus listed coordinates at the adjusted growth, with the list's sigmas.",
                  {{"Id", ""},
                   {"Rays", ""},
                   {"dx", "mm"},
                   {"dy", "mm"},
                   {"dz", "mm"},
                   {"sx", "mm"},
                   {"sy", "mm"},
                   {"sz", "mm"},
                   {"max d/s", ""}});
  table.limit_rows(1000, "markers.csv");
  for (const base::CommissionedMarker& marker : result.markers) {
    std::vector<Cell> row = {number_cell(std::to_string(marker.id), marker.id),
                             number_cell(std::to_string(marker.rays), marker.rays)};
    double worst = 0.0;
    for (const Eigen::Vector3d& triple : {marker.residual_mm, marker.sigma_mm}) {
      for (const double value : triple) row.push_back(number_cell(fixed(value, decimals), value));
    }
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (marker.sigma_mm(i) > 0.0) worst = std::max(worst, std::abs(marker.residual_mm(i)) / marker.sigma_mm(i));
    }
    row.push_back(number_cell(fixed(worst, 2), worst, worst > kLargeW ? "warning" : ""));
    table.add_row(std::move(row));
  }
  return definition_list(facts) + table.html();
}

}  // namespace crosstie::report::detail
