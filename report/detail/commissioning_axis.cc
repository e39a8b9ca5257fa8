#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/commissioning_sections.h"
#include "report/detail/error_motion.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/travel_plot.h"

namespace crosstie::report::detail {
namespace {

using base::ErrorMotion;
using base::LinearAxis;

std::string direction_table(const LinearAxis& axis) {
  HtmlTable table(
      "Direction of travel in the machine's axes, of unit length. The machine's X axis itself is (1, 0, 0): y and z say how "
      "far the "
      "head's travel leans from it.",
      {{"Quantity", "", "", false}, {"x", ""}, {"y", "mm/m"}, {"z", "mm/m"}});
  const Eigen::Vector3d& d = axis.direction_in_machine;
  const Eigen::Vector3d sigma = 1e3 * axis.direction_cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const int decimals = decimals_for_column(std::array{sigma.y(), sigma.z()}, 4);
  table.add_row({text_cell("Direction"), number_cell(fixed(d.x(), 9), d.x()), number_cell(fixed(1e3 * d.y(), decimals), d.y()),
                 number_cell(fixed(1e3 * d.z(), decimals), d.z())});
  table.add_row({text_cell("Sigma"), text_cell("\u2013"), number_cell(fixed(sigma.y(), decimals), sigma.y()),
                 number_cell(fixed(sigma.z(), decimals), sigma.z())});
  table.add_row({text_cell("U (k = 2)"), text_cell("\u2013"), number_cell(fixed(2.0 * sigma.y(), decimals), sigma.y()),
                 number_cell(fixed(2.0 * sigma.z(), decimals), sigma.z())});
  return table.html();
}

std::string terms_table(const base::MachineFrame& frame) {
  const LinearAxis& axis = frame.axis;
  HtmlTable table(
      fmt::format(
          "Error motions of the axis after ISO 230-1, each a Legendre polynomial over the travel, largest value equal to its "
          "coefficient. Coefficient and sigma are those of the axis, beside everything else that is unknown. Each was also "
          "tested alone, "
          "beside the significant ones: p says how often a coefficient at least as large as the one found there is found where "
          "there "
          "is none. Those with p below {} are significant; the others take part in the axis near zero, with their uncertainty.",
          plain(axis.level)),
      {{"Motion", "", "", false},
       {"What it is", "", "", false},
       {"Order", ""},
       {"Coefficient", ""},
       {"Sigma", ""},
       {"U", "", "k = 2"},
       {"Unit", "", "", false},
       {"Found", "", "by its test"},
       {"p", ""},
       {"Significant", "", "", false}});
  for (std::size_t i = 0; i < axis.terms.size(); ++i) {
    const ErrorMotion& term = axis.terms[i];
    const ShownMotion* shown = shown_motion(term.name);
    if (shown == nullptr) continue;
    const std::optional<double> joint = frame.term_sigma(i);
    const double value = term.value * shown->per_unit;
    const double sigma = joint.value_or(term.sigma) * shown->per_unit;
    const double found = term.coefficient * shown->per_unit;
    const int decimals = decimals_for_sigma(sigma, 1);
    const auto of_axis = [&](double number) {
      return joint ? number_cell(fixed(number, decimals), number) : text_cell("\u2013", "muted");
    };
    table.add_row({text_cell(term.name), text_cell(shown->name), number_cell(std::to_string(term.order), term.order),
                   of_axis(value), of_axis(sigma), of_axis(2.0 * sigma), text_cell(shown->unit),
                   number_cell(fixed(found, decimals), found),
                   number_cell(term.p < 1e-4 ? "< 0.0001" : significant(term.p, 2), term.p),
                   text_cell(term.significant ? "yes" : "no", term.significant ? "warning" : "muted")});
  }
  return table.html();
}

/// What a coefficient of 1 of this term makes at a reading.
double basis(const LinearAxis& axis, const ErrorMotion& term, double axis_mm) {
  LinearAxis one = axis;
  one.terms = {term};
  one.terms[0].value = 1.0;
  one.terms[0].in_frame = true;
  return one.value(term.name, axis_mm);
}

/// A motion over the travel: as it is part of the axis, with the joint covariance of its terms; where none takes part, what was found.
TravelCurve curve_of(const CommissioningView& view, const ShownMotion& shown, bool as_part) {
  const base::MachineFrame& frame = view.result.frame;
  TravelCurve curve{{}, {}, {}, shown.unit};
  for (const base::HeadPose& pose : view.along) {
    double value = 0.0;
    double found_variance = 0.0;
    Eigen::VectorXd row = Eigen::VectorXd::Zero(frame.cov.rows());
    Eigen::Index column = 9;
    for (const ErrorMotion& term : frame.axis.terms) {
      if (term.name == shown.letters && (term.in_frame || !as_part)) {
        const double at = basis(frame.axis, term, pose.axis_mm);
        value += (as_part ? term.value : term.coefficient) * at;
        found_variance += at * at * term.sigma * term.sigma;
        if (term.in_frame && column < row.size()) row(column) = at;
      }
      if (term.in_frame) ++column;
    }
    const double variance = as_part ? row.dot(frame.cov * row) : found_variance;
    curve.at_mm.push_back(pose.axis_mm);
    curve.value.push_back(value * shown.per_unit);
    curve.sigma.push_back(std::sqrt(std::max(0.0, variance)) * shown.per_unit);
  }
  return curve;
}

/// The stations' deviations from the axis, laid onto the curve.
std::vector<TravelMark> marks_of(const CommissioningView& view, const ShownMotion& shown) {
  std::vector<TravelMark> marks;
  for (const base::CommissionedStation& station : view.result.stations) {
    const Eigen::Vector3d turn = station.off_axis.head<3>();
    const Eigen::Vector3d shift = station.off_axis.tail<3>() + turn.cross(station.machine_from_rig.translation_mm);
    const double off = shown.angle ? turn(shown.component) : shift(shown.component);
    const double value = (view.result.frame.axis.value(shown.letters, station.axis_mm) + off) * shown.per_unit;
    marks.push_back({station.axis_mm, value,
                     fmt::format("{}: {} {} off the axis", station.name, significant(off * shown.per_unit, 2), shown.unit)});
  }
  return marks;
}

std::string motion_figure(const CommissioningView& view, const ShownMotion& shown) {
  const auto& terms = view.result.frame.axis.terms;
  const bool part = std::any_of(terms.begin(), terms.end(),
                                [&](const ErrorMotion& term) { return term.in_frame && term.name == shown.letters; });
  const bool proved = std::any_of(terms.begin(), terms.end(),
                                  [&](const ErrorMotion& term) { return term.significant && term.name == shown.letters; });
  const bool tested =
      std::any_of(terms.begin(), terms.end(), [&](const ErrorMotion& term) { return term.name == shown.letters; });
  const std::string plot = travel_plot(curve_of(view, shown, part), fmt::format("{}: {}", shown.letters, shown.name),
                                       fmt::format("{} [{}]", shown.letters, shown.unit), marks_of(view, shown), !proved);
  return figure(
      plot, proved   ? "Part of the axis. Band: U (k = 2). Dots: the stations."
            : part   ? "Not significant: near zero, part of the axis with its uncertainty. Band: U (k = 2). Dots: the stations."
            : tested ? "Not determined by the stations; dashed with its band: what the test saw. Dots: the stations."
                     : "Not tested: the stations do not carry it.");
}

}  // namespace

std::string commissioning_axis_section(const CommissioningView& view) {
  const LinearAxis& axis = view.result.frame.axis;
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Travel between the outermost stations", fmt::format("{} to {} mm", plain(axis.from_mm, 7), plain(axis.to_mm, 7))},
      {"Scale: travelled against read", with_sigma(axis.scale_ppm, axis.scale_sigma_ppm, "ppm")},
      {"Expanded (k = 2)", expanded(axis.scale_sigma_ppm, "ppm")},
      {"Probability of such a scale by chance",
       fmt::format("{}, {}", axis.scale_p < 1e-4 ? "< 0.0001" : significant(axis.scale_p, 2),
                   axis.scale_significant ? "significant" : "not significant")},
      {"Sigma of a reading, stated", fmt::format("{} mm", plain(axis.reading_sigma_mm))},
      {"Scatter of the stops beside it",
       axis.stop_sigma_mm > 0.0 || axis.stop_sigma_rad > 0.0
           ? fmt::format("{} mm, {} mrad", significant(axis.stop_sigma_mm, 2), significant(1e3 * axis.stop_sigma_rad, 2))
           : std::string("none shows")}};
  std::vector<std::string> plots;
  for (const ShownMotion& shown : kShownMotions) plots.push_back(motion_figure(view, shown));
  return definition_list(facts) + direction_table(axis) + terms_table(view.result.frame) + figures(plots);
}

}  // namespace crosstie::report::detail
