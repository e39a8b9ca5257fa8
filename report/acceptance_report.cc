#include "report/acceptance_report.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include <fmt/format.h>

#include "base/table.h"
#include "base/text.h"
#include "report/detail/heat_map.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/page.h"
#include "report/detail/plot.h"

namespace crosstie::report {
namespace {

using base::AcceptanceCharacteristic;
using base::AcceptancePosition;
using base::AcceptanceValue;
using base::format_double;
using base::FormFigures;
using detail::Cell;
using detail::fixed;
using detail::number_cell;
using detail::significant;
using detail::text_cell;

constexpr double kDegrees = 180.0 / std::numbers::pi;

std::string mm(double value, int digits = 3) { return significant(value, digits) + "\u00a0mm"; }

/// One value at one place.
struct Row {
  const AcceptancePosition* position;
  std::string sphere;
  const char* characteristic;
  const AcceptanceValue* value;
};

std::vector<Row> rows_of(const base::Acceptance& acceptance) {
  std::vector<Row> rows;
  for (const AcceptancePosition& position : acceptance.positions) {
    for (const base::MeasuredSphere& sphere : position.spheres) {
      rows.push_back({&position, sphere.name, "PF", &sphere.form});
      rows.push_back({&position, sphere.name, "PS", &sphere.size});
    }
    if (position.spacing) {
      rows.push_back({&position, "", "SD", &position.spacing->error});
      rows.push_back({&position, "", "SD, radii held", &position.spacing->held_error});
      if (acceptance.part == 3) rows.push_back({&position, "", "E", &position.spacing->length_error});
    }
    if (position.plane) rows.push_back({&position, "", "F", &position.plane->flatness});
  }
  return rows;
}

std::string level_text(const AcceptanceCharacteristic& of) {
  if (!of.limit_mm) return "not judged";
  switch (of.level) {
    case base::VerdictLevel::kOk:
      return "conforms";
    case base::VerdictLevel::kWarning:
      return "not proven";
    default:
      return "does not conform";
  }
}

std::string characteristics_section(const base::Acceptance& acceptance) {
  detail::HtmlTable table(
      "Worst value of all positions against the maximum permissible error. U = 2 sigma; ISO 14253-1: inside by more than U "
      "conforms, outside by more than U does not, between neither is proven.",
      {{"Characteristic", "", "", false},
       {"What it is", "", "", false},
       {"Positions", ""},
       {"Worst", "mm"},
       {"U", "mm"},
       {"Limit", "mm"},
       {"At", "", "", false},
       {"Verdict", "", "", false}});
  for (const AcceptanceCharacteristic& of : acceptance.characteristics) {
    const double sigma = of.value.sigma_mm();
    const std::string css = of.limit_mm ? detail::level_class(of.level) : "muted";
    table.add_row({text_cell(of.name), text_cell(of.about),
                   number_cell(fmt::format("{} of {}", of.positions, of.positions_asked), static_cast<double>(of.positions),
                               of.positions < of.positions_asked ? "warning" : ""),
                   number_cell(fixed(of.value.value_mm, detail::decimals_for_sigma(sigma, 4)), of.value.value_mm),
                   number_cell(significant(2.0 * sigma, 2), sigma),
                   of.limit_mm ? number_cell(detail::plain(*of.limit_mm), *of.limit_mm) : text_cell("\u2013"),
                   text_cell(of.worst), text_cell(level_text(of), css)});
  }
  return table.html() + detail::paragraph(
                            "The uncertainty is that of the number: noise of the points, neighbours that err together counted, "
                            "and the artefact's "
                            "certificate. What the head's calibration does wrong is what the test is to find, and in no sigma.",
                            "muted");
}

/// Values of one characteristic over the positions, with U and the limit.
std::string values_plot(const std::vector<Row>& rows, const AcceptanceCharacteristic& of) {
  std::vector<const Row*> own;
  double most = of.limit_mm.value_or(0.0);
  for (const Row& row : rows) {
    if (row.characteristic != of.name) continue;
    own.push_back(&row);
    most = std::max(most, std::abs(row.value->value_mm) + 2.0 * row.value->sigma_mm());
  }
  const bool both = of.name == "PS" || of.name == "SD" || of.name == "E";
  detail::Plot plot(of.name, fmt::format("{} values, the largest size {}", own.size(), mm(std::abs(of.value.value_mm))),
                    detail::make_axis(0.0, static_cast<double>(own.size()) + 1.0, 8, false),
                    detail::make_axis(both ? -most : 0.0, most), "position, in the order of the table", of.name + ", mm");
  for (std::size_t i = 0; i < own.size(); ++i) {
    const double x = static_cast<double>(i) + 1.0;
    const double value = own[i]->value->value_mm;
    const double u = 2.0 * own[i]->value->sigma_mm();
    plot.svg().line(plot.x_px(x), plot.y_px(value - u), plot.x_px(x), plot.y_px(value + u), "whisker");
    plot.point(x, value, of.limit_mm && std::abs(value) > *of.limit_mm ? "dot out" : "dot", "",
               fmt::format("{} {}: {}", own[i]->position->name, own[i]->sphere, mm(value)));
  }
  if (of.limit_mm) {
    const std::vector<double> x = {0.0, static_cast<double>(own.size()) + 1.0};
    for (const double sign : {1.0, -1.0}) {
      if (sign < 0.0 && !both) continue;
      plot.curve(x, std::vector<double>(2, sign * *of.limit_mm), "limit");
    }
    plot.legend("limit", "maximum permissible error");
  }
  plot.legend("whisker", "U = 2 sigma");
  return plot.str();
}

std::string positions_section(const base::Acceptance& acceptance, const std::vector<Row>& rows) {
  detail::HtmlTable values("All values.", {{"Position", "", "", false},
                                           {"Sphere", "", "", false},
                                           {"Characteristic", "", "", false},
                                           {"Value", "mm"},
                                           {"U", "mm"},
                                           {"Sigma of noise", "mm"},
                                           {"Sigma of artefact", "mm"}});
  for (const Row& row : rows) {
    const AcceptanceValue& v = *row.value;
    values.add_row({text_cell(row.position->name), text_cell(row.sphere), text_cell(row.characteristic),
                    number_cell(fixed(v.value_mm, detail::decimals_for_sigma(v.sigma_mm(), 4)), v.value_mm),
                    number_cell(significant(2.0 * v.sigma_mm(), 2), v.sigma_mm()),
                    number_cell(significant(v.noise_sigma_mm, 2), v.noise_sigma_mm),
                    number_cell(significant(v.artefact_sigma_mm, 2), v.artefact_sigma_mm)});
  }
  detail::HtmlTable points(
      "What the values were taken from. Sigma of noise: the points' own. Range by noise: what these alone would give. "
      "N_eff / N: how many independent points one is worth.",
      {{"Position", "", "", false},
       {"Sphere", "", "", false},
       {"Points", ""},
       {"Discarded", ""},
       {"Left out at the silhouette", ""},
       {"Cap", "\u00b0"},
       {"PF(sigma)", "mm"},
       {"Sigma of a point", "mm"},
       {"Range by noise", "mm"},
       {"N_eff / N", ""},
       {"Size by noise", "mm"}});
  const auto add = [&](const AcceptancePosition& position, const std::string& sphere, const FormFigures& f, double cap_rad,
                       double bias) {
    const bool known = f.point_sigma_mm > 0.0;
    const auto count = [](std::size_t n) {
      return number_cell(detail::counted(static_cast<long long>(n)), static_cast<double>(n));
    };
    points.add_row({text_cell(position.name), text_cell(sphere), count(f.count), count(f.discarded), count(f.beyond_cap),
                    cap_rad > 0.0 ? number_cell(fixed(cap_rad * kDegrees, 0), cap_rad) : text_cell("\u2013"),
                    number_cell(significant(f.rms_mm, 3), f.rms_mm),
                    known ? number_cell(significant(f.point_sigma_mm, 3), f.point_sigma_mm) : text_cell("unknown"),
                    known ? number_cell(significant(f.predicted_mm, 3), f.predicted_mm) : text_cell("unknown"),
                    number_cell(significant(f.independent_share, 2), f.independent_share),
                    cap_rad > 0.0 ? number_cell(fixed(bias, 4), bias) : text_cell("\u2013")});
  };
  for (const AcceptancePosition& position : acceptance.positions) {
    for (const base::MeasuredSphere& sphere : position.spheres)
      add(position, sphere.name, sphere.form_figures, sphere.cap_rad, sphere.size_bias_mm);
    if (position.plane) add(position, "", position.plane->form_figures, 0.0, 0.0);
  }
  return values.html() + points.html();
}

/// Mean deviations in cells over a cap or plate, laid flat.
std::string form_map(const std::string& name, const FormFigures& figures) {
  constexpr double kColumns = 36.0;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL);
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector2d& p : figures.places_mm) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  if (figures.places_mm.empty()) return "";
  const double cell = std::max((high - low).maxCoeff() / kColumns, 1e-6);
  const Eigen::Index columns = static_cast<Eigen::Index>((high.x() - low.x()) / cell) + 1;
  const Eigen::Index rows = static_cast<Eigen::Index>((high.y() - low.y()) / cell) + 1;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::MatrixXd count = Eigen::MatrixXd::Zero(rows, columns);
  for (std::size_t i = 0; i < figures.places_mm.size(); ++i) {
    const Eigen::Vector2d at = (figures.places_mm[i] - low) / cell;
    sum(static_cast<Eigen::Index>(at.y()), static_cast<Eigen::Index>(at.x())) += figures.deviations_mm[i];
    count(static_cast<Eigen::Index>(at.y()), static_cast<Eigen::Index>(at.x())) += 1.0;
  }
  detail::HeatGrid grid;
  grid.x = detail::make_axis(low.x(), low.x() + cell * static_cast<double>(columns), 5, false);
  grid.y = detail::make_axis(low.y(), low.y() + cell * static_cast<double>(rows), 5, false);
  grid.values = sum.cwiseQuotient(count);  // 0 / 0 where there is no point: the cell stays blank
  grid.value_name = "mean deviation";
  grid.unit = "mm";
  const double end = 2.0 * figures.rms_mm;
  return detail::heat_map(grid, name, "u, mm", "v, mm", {}, {.width_px = 420.0, .low = -end, .high = end});
}

std::string maps_section(const base::Acceptance& acceptance) {
  constexpr std::size_t kMostMaps = 12;
  std::vector<std::string> maps;
  for (const AcceptancePosition& position : acceptance.positions) {
    for (const base::MeasuredSphere& sphere : position.spheres)
      maps.push_back(form_map(fmt::format("{} {}", position.name, sphere.name), sphere.form_figures));
    if (position.plane) maps.push_back(form_map(position.name, position.plane->form_figures));
  }
  const std::size_t all = maps.size();
  if (all > kMostMaps) maps.resize(kMostMaps);
  std::string text =
      "Spheres are laid flat about the middle of their cap, equal in area; blue lies inside or below, red outside or above. "
      "The legend "
      "ends at twice PF(sigma) of each.";
  if (all > kMostMaps) text += fmt::format(" The first {} of {} are shown; form.csv has all.", kMostMaps, all);
  return detail::paragraph(text, "muted") + detail::figures(maps);
}

}  // namespace

std::string acceptance_report(const base::Acceptance& acceptance, const ReportContext& context) {
  detail::Page page(context);
  std::vector<detail::KeyFigure> figures;
  for (const AcceptanceCharacteristic& of : acceptance.characteristics) {
    figures.push_back(
        {of.name, detail::with_sigma(of.value.value_mm, of.value.sigma_mm(), "mm"),
         of.limit_mm ? fmt::format("limit {} mm: {}", detail::plain(*of.limit_mm), level_text(of)) : "no limit given",
         of.limit_mm ? detail::level_class(of.level) : ""});
  }
  page.key_figures(figures);
  const std::vector<Row> rows = rows_of(acceptance);
  page.section("characteristics", fmt::format("Characteristics after VDI/VDE 2634 part {}", acceptance.part),
               characteristics_section(acceptance));
  std::vector<std::string> plots;
  for (const AcceptanceCharacteristic& of : acceptance.characteristics) plots.push_back(values_plot(rows, of));
  page.section("values", "Over the positions", detail::figures(plots));
  page.section("positions", "Positions", positions_section(acceptance, rows));
  page.section("maps", "Deviations over the surface", maps_section(acceptance));
  return page.html();
}

base::Result<> write_acceptance_tables(const std::filesystem::path& folder, const base::Acceptance& acceptance) {
  base::Table table;
  table.columns = {"position", "artefact", "sphere",         "characteristic",
                   "value_mm", "sigma_mm", "noise_sigma_mm", "artefact_sigma_mm"};
  for (const Row& row : rows_of(acceptance)) {
    table.rows.push_back({row.position->name, row.position->artefact, row.sphere, row.characteristic,
                          format_double(row.value->value_mm), format_double(row.value->sigma_mm()),
                          format_double(row.value->noise_sigma_mm), format_double(row.value->artefact_sigma_mm)});
  }
  if (auto written = base::write_table(folder / "acceptance.csv", table); !written) return written;
  base::Table form;
  form.columns = {"position", "sphere", "u_mm", "v_mm", "deviation_mm"};
  const auto add = [&](const std::string& position, const std::string& sphere, const FormFigures& figures) {
    for (std::size_t i = 0; i < figures.places_mm.size(); ++i) {
      form.rows.push_back({position, sphere, format_double(figures.places_mm[i].x()), format_double(figures.places_mm[i].y()),
                           format_double(figures.deviations_mm[i])});
    }
  };
  for (const AcceptancePosition& position : acceptance.positions) {
    for (const base::MeasuredSphere& sphere : position.spheres) add(position.name, sphere.name, sphere.form_figures);
    if (position.plane) add(position.name, "", position.plane->form_figures);
  }
  return base::write_table(folder / "form.csv", form);
}

std::string repeatability_report(const base::Repeatability& repeatability, const ReportContext& context) {
  constexpr double kUnlikely = 0.001;
  detail::Page page(context);
  std::vector<detail::KeyFigure> figures;
  for (const base::RepeatedGroup& group : repeatability.groups) {
    figures.push_back({fmt::format("{}, standard deviation", group.name), mm(group.sd),
                       group.ratio > 0.0 ? fmt::format("over predicted sigma {} (95 %: {} to {})", significant(group.ratio, 2),
                                                       significant(group.ratio_low, 2), significant(group.ratio_high, 2))
                                         : "no sigma was given",
                       group.p < kUnlikely && group.ratio > 1.0 ? "warning" : ""});
  }
  page.key_figures(figures);
  detail::HtmlTable summary(
      "Scatter of the runs over the predicted sigma: 1 where the sigmas are true. What all runs have in common does not vary "
      "between them: a ratio below 1 proves nothing against sigmas that include it.",
      {{"Group", "", "", false},
       {"Quantities", ""},
       {"Standard deviation", "mm"},
       {"Predicted", "mm"},
       {"Ratio", ""},
       {"95 % from", ""},
       {"to", ""},
       {"Degrees of freedom", ""},
       {"p", ""},
       {"Compared", "", "", false}});
  for (const base::RepeatedGroup& g : repeatability.groups) {
    summary.add_row(
        {text_cell(g.name),
         number_cell(detail::counted(static_cast<long long>(g.quantities.size())), static_cast<double>(g.quantities.size())),
         number_cell(significant(g.sd, 3), g.sd), number_cell(significant(g.predicted, 3), g.predicted),
         number_cell(significant(g.ratio, 3), g.ratio, g.p < kUnlikely ? "warning" : ""),
         number_cell(significant(g.ratio_low, 3), g.ratio_low), number_cell(significant(g.ratio_high, 3), g.ratio_high),
         number_cell(significant(g.dof, 3), g.dof), number_cell(significant(g.p, 2), g.p), text_cell(g.about)});
  }
  std::string runs;
  for (const std::string& run : repeatability.runs) runs += (runs.empty() ? "" : ", ") + run;
  page.section("groups", "Are the sigmas true",
               detail::paragraph(fmt::format("{} runs of {}: {}.", repeatability.runs.size(), repeatability.verb, runs)) +
                   summary.html());
  for (std::size_t k = 0; k < repeatability.groups.size(); ++k) {
    const base::RepeatedGroup& group = repeatability.groups[k];
    std::string plot_text;
    if (group.quantities.size() > 3) {
      double most = group.predicted;
      std::vector<double> x;
      std::vector<double> predicted;
      for (std::size_t i = 0; i < group.quantities.size(); ++i) {
        x.push_back(static_cast<double>(i) + 1.0);
        predicted.push_back(group.quantities[i].predicted);
        most = std::max({most, group.quantities[i].sd, group.quantities[i].predicted});
      }
      detail::Plot plot(group.name, fmt::format("{} quantities", x.size()),
                        detail::make_axis(0.0, static_cast<double>(x.size()) + 1.0, 8, false), detail::make_axis(0.0, most),
                        "quantity, in the order of the table", "standard deviation, mm",
                        {.width_px = 860.0, .height_px = 260.0});
      for (std::size_t i = 0; i < x.size(); ++i)
        plot.point(x[i], group.quantities[i].sd, "dot", "",
                   fmt::format("{}: {}", group.quantities[i].name, mm(group.quantities[i].sd)), 2.2);
      plot.curve(x, predicted, "limit");
      plot.legend("limit", "predicted sigma");
      plot_text = plot.str();
    }
    detail::HtmlTable table("Mean and standard deviation of one run with its 95 % interval.", {{"Quantity", "", "", false},
                                                                                               {"Mean", "mm"},
                                                                                               {"Standard deviation", "mm"},
                                                                                               {"from", "mm"},
                                                                                               {"to", "mm"},
                                                                                               {"Predicted", "mm"},
                                                                                               {"Ratio", ""},
                                                                                               {"p", ""}});
    table.limit_rows(120, "repeatability.csv");
    for (const base::RepeatedQuantity& q : group.quantities) {
      table.add_row({text_cell(q.name), number_cell(fixed(q.mean, detail::decimals_for_sigma(q.sd, 4)), q.mean),
                     number_cell(significant(q.sd, 2), q.sd), number_cell(significant(q.sd_low, 2), q.sd_low),
                     number_cell(significant(q.sd_high, 2), q.sd_high), number_cell(significant(q.predicted, 2), q.predicted),
                     number_cell(significant(q.ratio, 2), q.ratio, q.p < kUnlikely && q.ratio > 1.0 ? "warning" : ""),
                     number_cell(significant(q.p, 2), q.p)});
    }
    page.section(fmt::format("group-{}", k + 1), group.name, plot_text + table.html());
  }
  return page.html();
}

base::Result<> write_repeatability_tables(const std::filesystem::path& folder, const base::Repeatability& repeatability) {
  base::Table table;
  table.columns = {"group", "quantity", "mean_mm", "sd_mm", "sd_low_mm", "sd_high_mm", "predicted_mm", "ratio", "p"};
  for (const base::RepeatedGroup& group : repeatability.groups) {
    for (const base::RepeatedQuantity& q : group.quantities) {
      table.rows.push_back({group.name, q.name, format_double(q.mean), format_double(q.sd), format_double(q.sd_low),
                            format_double(q.sd_high), format_double(q.predicted), format_double(q.ratio), format_double(q.p)});
    }
  }
  return base::write_table(folder / "repeatability.csv", table);
}

}  // namespace crosstie::report
