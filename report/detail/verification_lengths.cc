#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plot.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report::detail {
namespace {

using base::LengthDeviation;
using base::Verification;

constexpr std::size_t kMaxRows = 60;

double error_mm(const LengthDeviation& length) { return length.measured_mm - length.nominal_mm; }

std::string length_plot(const std::vector<LengthDeviation>& lengths, const LengthUnit& unit) {
  double longest = 0.0;
  double highest = 0.0;
  for (const LengthDeviation& length : lengths) {
    longest = std::max(longest, length.nominal_mm);
    const double reach = std::abs(error_mm(length)) + 2.0 * std::max(0.0, length.sigma_mm);
    highest = std::max({highest, (std::isfinite(reach) ? reach : 0.0) * unit.per_mm, length.mpe_mm * unit.per_mm});
  }
  Plot plot("Length errors over length", fmt::format("{} test lengths with the maximum permissible error", lengths.size()),
            make_axis(0.0, longest, 8), make_axis(-highest, highest, 8), "length of the reference [mm]",
            fmt::format("error [{}]", unit.name), {.width_px = 1100.0, .height_px = 380.0});
  plot.svg().line(plot.left(), plot.y_px(0.0), plot.right(), plot.y_px(0.0), "zero");
  const bool dense = lengths.size() > 400;
  for (const LengthDeviation& length : lengths) {
    const double error = error_mm(length);
    const bool outside = std::abs(error) > length.mpe_mm;
    if (!dense && length.sigma_mm > 0.0) {
      plot.whisker(length.nominal_mm, (error - 2.0 * length.sigma_mm) * unit.per_mm,
                   (error + 2.0 * length.sigma_mm) * unit.per_mm);
    }
    plot.point(length.nominal_mm, error * unit.per_mm,
               outside ? "dot out"
               : dense ? "dot faint"
                       : "dot",
               "", fmt::format("{}-{}: {} {}", length.id_a, length.id_b, significant(error * unit.per_mm), unit.name),
               dense ? 1.8 : 2.6);
  }
  for (const double sign : {1.0, -1.0}) {
    std::vector<double> x;
    std::vector<double> y;
    for (const LengthDeviation& length : lengths) {
      x.push_back(length.nominal_mm);
      y.push_back(sign * length.mpe_mm * unit.per_mm);
    }
    plot.curve(x, y, "limit");
  }
  plot.legend("limit", "maximum permissible error \u00b1(A + L / K)");
  return plot.str();
}

}  // namespace

std::string verification_lengths_section(const Verification& verification) {
  if (verification.lengths.empty()) return paragraph("There is no test length.");
  std::vector<LengthDeviation> sorted = verification.lengths;
  std::sort(sorted.begin(), sorted.end(), [](const LengthDeviation& a, const LengthDeviation& b) {
    return std::tie(a.nominal_mm, a.id_a, a.id_b) < std::tie(b.nominal_mm, b.id_a, b.id_b);
  });
  std::vector<double> errors;
  std::vector<double> sigmas;
  for (const LengthDeviation& length : sorted) {
    errors.push_back(std::abs(error_mm(length)));
    sigmas.push_back(length.sigma_mm);
  }
  const LengthUnit unit = unit_for_lengths(errors);
  std::string html = paragraph(fmt::format(
      "Distances between pairs of points, measured minus reference, as the length measurement error of VDI/VDE 2634 part 1 is "
      "plotted. {} "
      "lengths from {} to {} mm; distances that define the scale are no test lengths. Lengths that share a point are not "
      "independent.",
      counted(static_cast<long long>(sorted.size())), fixed(sorted.front().nominal_mm, 1), fixed(sorted.back().nominal_mm, 1)));
  html += figure(length_plot(sorted, unit),
                 "Error of each test length; dashed: maximum permissible error. Bars, where drawn: U (k = 2).", true);

  std::stable_sort(sorted.begin(), sorted.end(), [](const LengthDeviation& a, const LengthDeviation& b) {
    return std::abs(error_mm(a)) / std::max(a.mpe_mm, 1e-12) > std::abs(error_mm(b)) / std::max(b.mpe_mm, 1e-12);
  });
  for (double& sigma : sigmas) sigma *= unit.per_mm;
  const int decimals = decimals_for_column(sigmas, 3);
  const int length_decimals = std::min(9, decimals + (unit.per_mm > 1.0 ? 3 : 0));
  HtmlTable table("Test lengths, those that use most of their permissible error first.",
                  {{"Pair", "", "", false},
                   {"Reference", "mm"},
                   {"Measured", "mm"},
                   {"Error", unit.name},
                   {"Sigma", unit.name},
                   {"U", unit.name, "k = 2"},
                   {"MPE", unit.name, "maximum permissible error A + L/K"},
                   {"Error / MPE", "%"}});
  table.limit_rows(kMaxRows, "lengths.csv");
  for (const LengthDeviation& length : sorted) {
    const double error = error_mm(length);
    const double share = length.mpe_mm > 0.0 ? 100.0 * std::abs(error) / length.mpe_mm : 0.0;
    const auto cell = [&](double value) { return number_cell(fixed(value * unit.per_mm, decimals), value); };
    table.add_row({text_cell(fmt::format("{}\u2013{}", length.id_a, length.id_b)),
                   number_cell(fixed(length.nominal_mm, length_decimals), length.nominal_mm),
                   number_cell(fixed(length.measured_mm, length_decimals), length.measured_mm), cell(error),
                   length.sigma_mm > 0.0 ? cell(length.sigma_mm) : text_cell("\u2013"),
                   length.sigma_mm > 0.0 ? cell(2.0 * length.sigma_mm) : text_cell("\u2013"), cell(length.mpe_mm),
                   number_cell(fixed(share, 0), share, share > 100.0 ? "fail" : "")});
  }
  return html + table.html();
}

}  // namespace crosstie::report::detail
