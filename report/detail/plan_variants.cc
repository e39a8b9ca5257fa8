#include <cmath>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plan_sections.h"

namespace crosstie::report::detail {
namespace {

using base::PlanVariant;
using base::ScenePlan;

struct Figure {
  Column column;
  double per_unit;
  double PlanVariant::*value;
};

/// The figures that this plan has.
std::vector<Figure> figures_of(const ScenePlan& plan) {
  std::vector<Figure> figures;
  if (plan.machine) {
    figures = {
        {{"Direction", "\u00b5rad", "sigma"}, 1e6, &PlanVariant::direction_sigma_rad},
        {{"Scale", "ppm", "sigma"}, 1.0, &PlanVariant::scale_sigma_ppm},
        {{"Straightness", "\u00b5m", "smallest parabola that is found, peak to valley"}, 1e3, &PlanVariant::straightness_mm},
        {{"Roll", "\u00b5rad", "smallest linear one that is found, over the travel"}, 1e6, &PlanVariant::roll_rad},
        {{"Pitch", "\u00b5rad", "smallest linear one that is found, over the travel"}, 1e6, &PlanVariant::pitch_rad},
        {{"Yaw", "\u00b5rad", "smallest linear one that is found, over the travel"}, 1e6, &PlanVariant::yaw_rad}};
  }
  if (plan.calibration) figures.push_back({{"Baseline", "mm", "sigma"}, 1.0, &PlanVariant::baseline_sigma_mm});
  if (plan.network) {
    figures.push_back({{"Points, median", "mm", "sigma"}, 1.0, &PlanVariant::network_median_mm});
    figures.push_back({{"Points, largest", "mm", "sigma"}, 1.0, &PlanVariant::network_max_mm});
  }
  return figures;
}

}  // namespace

std::string plan_variants_section(const ScenePlan& plan) {
  const std::vector<Figure> figures = figures_of(plan);
  std::vector<Column> columns = {{"Changed", "", "", false}, {"To", "", "", false}};
  for (std::size_t i = 0; i < plan.points.size(); ++i) {
    columns.push_back(
        {fmt::format("Point {}", i + 1), "mm", "largest sigma of a target measured there, else by the frame alone"});
  }
  for (const Figure& figure : figures) columns.push_back(figure.column);
  HtmlTable table("One thing is changed at a time, the rest stays as in the scene. Points in the order of the table above.",
                  columns);
  for (const PlanVariant& variant : plan.variants) {
    std::vector<Cell> row = {text_cell(variant.what, variant.as_planned ? "ok" : ""), text_cell(variant.value)};
    const auto add = [&](double value) {
      row.push_back(std::isfinite(value) ? number_cell(significant(value), value) : text_cell("\u2013"));
    };
    if (variant.failure.empty()) {
      for (std::size_t i = 0; i < plan.points.size(); ++i)
        add(i < variant.points_mm.size() ? variant.points_mm[i] : std::nan(""));
      for (const Figure& figure : figures) add(figure.per_unit * (variant.*figure.value));
    } else {
      row.push_back(text_cell(variant.failure, "prose"));
      row.resize(columns.size());
    }
    table.add_row(std::move(row));
  }
  return table.html();
}

}  // namespace crosstie::report::detail
