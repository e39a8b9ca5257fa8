#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "report/detail/commissioning_sections.h"
#include "report/detail/correlation.h"
#include "report/detail/heat_map.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"
#include "report/detail/volume_section.h"

namespace crosstie::report::detail {
namespace {

using base::Commissioning;

double largest_u_mm(const Commissioning& result) {
  double largest = 0.0;
  for (const base::FramePoint& point : result.tre) largest = std::max(largest, 2.0 * largest_sigma(point.cov_mm2));
  return largest;
}

KeyFigure motions_figure(const base::LinearAxis& axis) {
  std::string names;
  for (const base::ErrorMotion& term : axis.terms) {
    if (term.significant && names.find(term.name) == std::string::npos) names += (names.empty() ? "" : ", ") + term.name;
  }
  return {"Error motions found", names.empty() ? "none" : names,
          fmt::format("{} terms tested at the level {}", axis.terms.size(), plain(axis.level)), ""};
}

}  // namespace

std::vector<KeyFigure> commissioning_key_figures(const CommissioningView& view) {
  const Commissioning& result = view.result;
  const base::LinearAxis& axis = result.frame.axis;
  const double direction_mrad = 1e3 * std::sqrt(std::max(0.0, 0.5 * axis.direction_cov.trace()));
  std::vector<KeyFigure> figures;
  if (!result.tre.empty()) {
    const double u = largest_u_mm(result);
    figures.push_back({"Frame over the working volume", fmt::format("U up to {} mm", significant(u, 2)),
                       "k = 2, worst point and direction; what the frame adds to any point", ""});
  }
  figures.push_back(
      {"Axis direction, sigma", fmt::format("{} mrad", significant(direction_mrad, 2)), expanded(direction_mrad, "mrad"), ""});
  figures.push_back(
      {"Axis scale", with_sigma(axis.scale_ppm, axis.scale_sigma_ppm, "ppm"), expanded(axis.scale_sigma_ppm, "ppm"), ""});
  figures.push_back(motions_figure(axis));
  figures.push_back({"Spheres, FRE", fmt::format("{} mm", significant(result.fre_mm, 2)),
                     fmt::format("{} spheres; {}", result.spheres.size(), result.datum), ""});
  figures.push_back({"Baseline", with_sigma(result.baseline_mm, result.baseline_sigma_mm, "mm"),
                     expanded(result.baseline_sigma_mm, "mm"), ""});
  figures.push_back({"Image coordinate, sigma0", fmt::format("{} px", significant(result.sigma0_px, 3)),
                     fmt::format("stated sigmas times {}; rms per point {} px", significant(result.image_sigma_factor, 3),
                                 significant(result.rms_px, 3)),
                     ""});
  figures.push_back({"Redundancy", counted(result.redundancy),
                     fmt::format("n {} \u2212 u {}", counted(result.observations), counted(result.unknowns)), ""});
  figures.push_back({"Stations", std::to_string(result.stations.size()),
                     fmt::format("{} images, {} image points, {} left out", result.images.size(),
                                 counted(static_cast<long long>(result.residuals.size())), result.rejected.size()),
                     ""});
  return figures;
}

std::string commissioning_volume_section(const CommissioningView& view) { return volume_section(view.volume); }

std::string volume_section(const std::vector<VolumeMap>& volume) {
  std::string html = paragraph(
      "Expanded uncertainty U (k = 2) of where a point lies in machine, in its worst direction, by the frame alone: spheres, "
      "cross, axis, "
      "lenses and rig as commissioned (target registration error). What a later scan measures adds its own noise.");
  double high = 0.0;
  for (const VolumeMap& map : volume) {
    if (map.expanded_mm.size() > 0) high = std::max(high, map.expanded_mm.maxCoeff());
  }
  std::vector<std::string> maps;
  for (const VolumeMap& map : volume) {
    const HeatGrid grid{make_axis(map.x_low, map.x_high, 5, false), make_axis(map.y_low, map.y_high, 5, false), map.expanded_mm,
                        "U", "mm"};
    maps.push_back(figure(heat_map(grid, map.title, map.x_label, map.y_label, {}, {.high = high}), map.title + "."));
  }
  return html + figures(maps);
}

std::string commissioning_adjustment_section(const CommissioningView& view) {
  const Commissioning& result = view.result;
  std::string html =
      definition_list({{"sigma0, all observations as weighted", significant(result.sigma0, 3)},
                       {"Probability of a sum of squares this far off", significant(result.chi2_p, 2)},
                       {"Factor on the stated sigmas of image points", significant(result.image_sigma_factor, 3)},
                       {"Largest eccentricity corrected", fmt::format("{} px", significant(result.largest_eccentricity_px, 2))},
                       {"Iterations", std::to_string(result.iterations)},
                       {"Weakest combination", result.weakest},
                       {"Least eigenvalue, scaled", significant(result.least_eigenvalue, 2)}});
  HtmlTable table(
      "Where the observations come from and how their residuals compare with their sigmas. The ratio v'Pv over redundancy is "
      "near 1 where "
      "the sigmas are true; a kind without redundancy is not tested by this adjustment.",
      {{"Kind", "", "", false}, {"Observations", ""}, {"Redundancy", ""}, {"Share tested", "%"}, {"v'Pv / redundancy", ""}});
  for (const base::ObservationGroup& group : result.groups) {
    const double share = group.observations > 0 ? 100.0 * group.redundancy / group.observations : 0.0;
    table.add_row({text_cell(group.name), number_cell(std::to_string(group.observations), group.observations),
                   number_cell(fixed(group.redundancy, 1), group.redundancy), number_cell(fixed(share, 0), share),
                   group.ratio > 0.0 ? number_cell(fixed(group.ratio, 2), group.ratio) : text_cell("\u2013")});
  }
  html += table.html();

  // The frame's own parameters: what is correlated there moves the head together.
  std::vector<std::string> names = {"rx", "ry", "rz", "tx", "ty", "tz", "dir 1", "dir 2", "scale"};
  for (const base::ErrorMotion& term : result.frame.axis.terms) {
    if (term.significant) names.push_back(fmt::format("{} {}", term.name, term.order));
  }
  if (result.frame.cov.rows() == static_cast<Eigen::Index>(names.size())) {
    constexpr double kFlagged = 0.95;
    html +=
        figure(correlation_map(correlation_matrix(result.frame.cov), names, "Correlations of the frame's parameters", kFlagged),
               "Head at the middle of the travel (turns, shifts), direction, scale and error motions; framed beyond 0.95.");
  }
  return html;
}

std::string commissioning_rejected_section(const CommissioningView& view) {
  if (view.result.rejected.empty()) return paragraph("Nothing was left out.");
  HtmlTable table("What did not take part, and why. w is its standardised residual against the rest.",
                  {{"What", "", "", false}, {"Marker", ""}, {"Reason", "", "", false}, {"w", ""}});
  table.limit_rows(1000, "rejected.csv");
  for (const Commissioning::Rejected& one : view.result.rejected) {
    table.add_row({text_cell(one.subject), one.id >= 0 ? number_cell(std::to_string(one.id), one.id) : text_cell("\u2013"),
                   text_cell(one.reason, "prose"), number_cell(fixed(one.w, 1), one.w)});
  }
  return table.html();
}

}  // namespace crosstie::report::detail
