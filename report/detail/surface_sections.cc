#include "report/detail/surface_sections.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "report/detail/charts.h"
#include "report/detail/heat_map.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plot.h"

namespace crosstie::report::detail {
namespace {

using base::EdgeVerification;
using base::ShapeDeviations;
using base::SurfaceDeviations;

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kColumns = 72.0;
constexpr double kLegendTolerances = 2.0;  // the legend ends at twice the tolerance, whatever the deviations are

std::string mm(double value, int digits = 3) { return significant(value, digits) + "\u00a0mm"; }

std::string percent(double share) { return fixed(100.0 * share, 1) + "\u00a0%"; }

/// Mean deviations in cells over the two directions in which the points extend most.
std::string deviation_map(const SurfaceDeviations& surface) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : surface.points) mean += p / static_cast<double>(surface.points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& p : surface.points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  Eigen::Vector3d right = eigen.eigenvectors().col(2);
  Eigen::Vector3d up = eigen.eigenvectors().col(1);
  for (Eigen::Vector3d* axis : {&right, &up}) {
    Eigen::Index largest = 0;
    axis->cwiseAbs().maxCoeff(&largest);
    if ((*axis)(largest) < 0.0) *axis = -*axis;
  }
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL);
  Eigen::Vector2d high = -low;
  std::vector<Eigen::Vector2d> flat;
  for (const auto& p : surface.points) {
    flat.emplace_back(right.dot(p - mean), up.dot(p - mean));
    low = low.cwiseMin(flat.back());
    high = high.cwiseMax(flat.back());
  }
  const double cell = std::max((high - low).maxCoeff() / kColumns, 1e-6);
  const auto columns = static_cast<Eigen::Index>(std::floor((high.x() - low.x()) / cell)) + 1;
  const auto rows = static_cast<Eigen::Index>(std::floor((high.y() - low.y()) / cell)) + 1;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::MatrixXd count = Eigen::MatrixXd::Zero(rows, columns);
  for (std::size_t i = 0; i < flat.size(); ++i) {
    const auto column = static_cast<Eigen::Index>((flat[i].x() - low.x()) / cell);
    const auto row = static_cast<Eigen::Index>((flat[i].y() - low.y()) / cell);
    sum(row, column) += surface.deviations_mm[i];
    count(row, column) += 1.0;
  }
  HeatGrid grid;
  grid.x = make_axis(low.x(), low.x() + cell * static_cast<double>(columns), 6, false);
  grid.y = make_axis(low.y(), low.y() + cell * static_cast<double>(rows), 6, false);
  grid.values = sum.cwiseQuotient(count);  // 0 / 0 where there is no point: the cell stays blank
  grid.value_name = "mean deviation";
  grid.unit = "mm";
  const double end = kLegendTolerances * surface.tolerance_mm;
  const auto axis_text = [](const Eigen::Vector3d& axis) {
    return fmt::format("along ({}, {}, {}), mm", fixed(axis.x(), 2), fixed(axis.y(), 2), fixed(axis.z(), 2));
  };
  return heat_map(grid, "Deviation from the reference", axis_text(right), axis_text(up), {},
                  {.width_px = 860.0, .low = -end, .high = end});
}

}  // namespace

std::vector<KeyFigure> surface_key_figures(const base::SurfaceVerification& verification) {
  std::vector<KeyFigure> figures;
  if (verification.surface) {
    const SurfaceDeviations& s = *verification.surface;
    figures.push_back({"Surface, mean and scatter", fmt::format("{} \u00b1 {}", mm(s.mean_mm), mm(s.sigma_mm)),
                       fmt::format("{} points against a {}", counted(static_cast<long long>(s.count)), s.reference), ""});
    figures.push_back({"Within the tolerance", percent(s.in_tolerance),
                       fmt::format("\u00b1{}; 95 % within {}", mm(s.tolerance_mm), mm(s.p95_mm)), ""});
  }
  if (verification.shape) {
    const ShapeDeviations& s = *verification.shape;
    figures.push_back({s.shape == "cone" ? "Cone, diameter at its middle" : "Cylinder, diameter",
                       with_sigma(s.diameter_mm, s.diameter_sigma_mm, "mm"), expanded(s.diameter_sigma_mm, "mm"), ""});
  }
  if (verification.edge) {
    const EdgeVerification& e = *verification.edge;
    figures.push_back(
        {"Rim, rms / largest", fmt::format("{} / {}", mm(e.rms_mm), mm(e.max_mm)),
         e.normalised_rms > 0.0 ? fmt::format("deviation over sigma, rms {}", significant(e.normalised_rms, 3)) : std::string(),
         ""});
  }
  return figures;
}

std::string surface_section(const SurfaceDeviations& s) {
  std::vector<std::pair<std::string, std::string>> entries = {
      {"Points", fmt::format("{} compared; {} nearest to the reference's border and {} farther than {} were left out",
                             counted(static_cast<long long>(s.count)), counted(static_cast<long long>(s.beyond_border)),
                             counted(static_cast<long long>(s.too_far)), mm(s.gate_mm))},
      {"Mean", mm(s.mean_mm)},
      {"Scatter about the mean", mm(s.sigma_mm)},
      {"Root mean square", mm(s.rms_mm)},
      {"95 % of the sizes are below", mm(s.p95_mm)},
      {"Largest size", mm(s.max_mm)},
      {fmt::format("Share within \u00b1{}", mm(s.tolerance_mm)), percent(s.in_tolerance)}};
  if (s.normalised_rms) entries.emplace_back("Deviation over the points' own sigma, rms", significant(*s.normalised_rms, 3));
  std::string placed = "The cloud is compared where it lies: no fit.";
  if (s.best_fit) {
    placed = fmt::format("The cloud was first laid onto the reference, point to plane (ICP, {} iterations).", s.iterations);
    if (!s.held.empty()) {
      placed += " The surface does not determine these directions, in which it stays: ";
      for (std::size_t i = 0; i < s.held.size(); ++i) placed += (i > 0 ? ", " : "") + s.held[i];
      placed += ".";
    }
  }
  std::vector<double> values = s.deviations_mm;
  return paragraph(placed) + definition_list(entries) + "<h3>Map</h3>\n" + deviation_map(s) +
         paragraph(
             fmt::format(
                 "Blue lies under the reference, red over it. The legend ends at \u00b1{} times the tolerance in every report; "
                 "cells beyond have its last colour.",
                 plain(kLegendTolerances)),
             "muted") +
         "<h3>Histogram</h3>\n" +
         histogram(values, "Deviations", "deviation, mm", {{s.sigma_mm, "scatter about the mean, drawn about 0"}});
}

std::string shape_section(const ShapeDeviations& s) {
  const bool cone = s.shape == "cone";
  const auto triple = [](const Eigen::Vector3d& v, int decimals) {
    return fmt::format("{}, {}, {}", fixed(v.x(), decimals), fixed(v.y(), decimals), fixed(v.z(), decimals));
  };
  HtmlTable table("Fitted, with standard uncertainties, and less its nominal. U = 2 sigma.", {{"Quantity", "", "", false},
                                                                                              {"Value", ""},
                                                                                              {"Sigma", ""},
                                                                                              {"Fitted less nominal", ""},
                                                                                              {"Sigma", ""},
                                                                                              {"Unit", "", "", false}});
  const auto row = [&](const std::string& name, double value, double sigma,
                       const std::optional<std::pair<double, double>>& difference, const std::string& unit) {
    const int decimals = decimals_for_sigma(sigma, 4);
    std::vector<Cell> cells = {text_cell(name), number_cell(fixed(value, decimals), value),
                               number_cell(significant(sigma, 2), sigma)};
    if (difference) {
      const bool large = difference->second > 0.0 && std::abs(difference->first) > 3.29 * difference->second;
      cells.push_back(number_cell(fixed(difference->first, decimals_for_sigma(difference->second, 4)), difference->first,
                                  large ? "warning" : ""));
      cells.push_back(number_cell(significant(difference->second, 2), difference->second));
    } else {
      cells.push_back(text_cell("\u2013"));
      cells.push_back(text_cell("\u2013"));
    }
    cells.push_back(text_cell(unit));
    table.add_row(std::move(cells));
  };
  using Pair = std::optional<std::pair<double, double>>;
  const auto& d = s.difference;
  row(cone ? "Diameter at the point of the axis" : "Diameter", s.diameter_mm, s.diameter_sigma_mm,
      d ? Pair({d->diameter_mm, d->diameter_sigma_mm}) : Pair(), "mm");
  if (cone) {
    row("Diameter at the low end", s.low_diameter_mm, s.low_diameter_sigma_mm, Pair(), "mm");
    row("Diameter at the high end", s.high_diameter_mm, s.high_diameter_sigma_mm, Pair(), "mm");
    row("Apex angle, full", kDegrees * s.apex_angle_rad, kDegrees * s.apex_angle_sigma_rad,
        d ? Pair({kDegrees * d->apex_angle_rad, kDegrees * d->apex_angle_sigma_rad}) : Pair(), "\u00b0");
  }
  if (d) {
    row("Angle between the axes", kDegrees * d->axis_angle_rad, kDegrees * d->axis_angle_sigma_rad, Pair(), "\u00b0");
    row("Distance of the axes", d->axis_distance_mm, d->axis_distance_sigma_mm, Pair(), "mm");
  }
  const std::string place = fmt::format(
      "Axis through ({}) mm along ({}), sigmas of the direction ({}) \u00b5rad; points from {} to {} mm along it. {} points, "
      "{} left out as "
      "strays; scatter {}, form {} (highest less lowest).",
      triple(s.point_mm, 3), triple(s.direction, 6), triple(1e6 * s.direction_sigma_rad, 1), fixed(s.low_mm, 0),
      fixed(s.high_mm, 0), counted(static_cast<long long>(s.count)), counted(static_cast<long long>(s.rejected)), mm(s.rms_mm),
      mm(s.form_mm));
  return paragraph(place) + table.html();
}

std::string hair_diagram(const std::vector<double>& s_mm, const std::vector<double>& deviation_mm,
                         const std::vector<double>& sigma_mm, std::string_view title, std::string_view y_label) {
  std::vector<std::size_t> order(s_mm.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return s_mm[a] < s_mm[b]; });
  double most = 0.0;
  std::vector<double> s;
  std::vector<double> low;
  std::vector<double> high;
  for (const std::size_t i : order) {
    const double two_sigma = i < sigma_mm.size() ? 2.0 * sigma_mm[i] : 0.0;
    s.push_back(s_mm[i]);
    low.push_back(-two_sigma);
    high.push_back(two_sigma);
    most = std::max({most, std::abs(deviation_mm[i]), two_sigma});
  }
  Plot plot(title,
            fmt::format("{} hairs along {} mm, the longest {} mm", s.size(), s.empty() ? 0.0 : std::round(s.back()),
                        significant(most, 3)),
            make_axis(s.empty() ? 0.0 : s.front(), s.empty() ? 1.0 : s.back()), make_axis(-most, most), "arc length, mm",
            y_label, {.width_px = 860.0, .height_px = 260.0});
  plot.band(s, low, high, "band");
  for (const std::size_t i : order) {
    plot.svg().line(plot.x_px(s_mm[i]), plot.y_px(0.0), plot.x_px(s_mm[i]), plot.y_px(deviation_mm[i]), "whisker");
  }
  const std::vector<double> ends = {s.empty() ? 0.0 : s.front(), s.empty() ? 1.0 : s.back()};
  const std::vector<double> zeros = {0.0, 0.0};
  plot.curve(ends, zeros, "zero");
  plot.legend("whisker", "deviation");
  plot.legend("band", "\u00b12 sigma");
  return plot.str();
}

std::string edge_section(const EdgeVerification& e) {
  return definition_list({{"Points", counted(static_cast<long long>(e.count))},
                          {"Distance, rms", mm(e.rms_mm)},
                          {"95 % are below", mm(e.p95_mm)},
                          {"Largest", mm(e.max_mm)},
                          {"Deviation over sigma, rms",
                           e.normalised_rms > 0.0 ? significant(e.normalised_rms, 3) : std::string("no sigma was given")}}) +
         hair_diagram(e.s_mm, e.u_mm, e.sigma_u_mm, "Across the rim, in the surface", "u, mm (into the opening)") +
         hair_diagram(e.s_mm, e.v_mm, e.sigma_v_mm, "Along the normal", "v, mm");
}

}  // namespace crosstie::report::detail
