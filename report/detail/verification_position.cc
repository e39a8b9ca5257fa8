#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report::detail {

using base::Deviation;
using base::PositionComparison;

std::string verification_position_section(const base::Verification& verification) {
  constexpr std::size_t kMaxRows = 3000;
  constexpr double kLargeNormalised = 3.29;  // 0.1 % two-sided
  const PositionComparison& comparison = verification.by_position;
  std::vector<double> sizes;
  std::vector<double> sigmas;
  for (const Deviation& one : comparison.points) sizes.push_back(one.deviation_mm.norm());
  const LengthUnit unit = unit_for_lengths(sizes);
  for (double& size : sizes) size *= unit.per_mm;
  for (const Deviation& one : comparison.points) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) sigmas.push_back(one.sigma_mm(axis) * unit.per_mm);
  }
  const auto in_unit = [&](double length_mm) { return significant(length_mm * unit.per_mm, 3); };
  std::string text = paragraph(fmt::format(
      "Targets without a code have no common ids. Each is compared with the nearest point of the reference that has no other "
      "partner, within {} mm after the fit of the others: {} of {} have one.",
      plain(comparison.gate_mm), comparison.points.size(), comparison.points.size() + comparison.unpaired.size()));
  if (comparison.points.empty()) return text;
  text += definition_list(
      {{"Deviation, rms x / y / z", fmt::format("{} / {} / {} {}", in_unit(comparison.rms_mm.x()),
                                                in_unit(comparison.rms_mm.y()), in_unit(comparison.rms_mm.z()), unit.name)},
       {"3D deviation, rms / largest",
        fmt::format("{} / {} {}", in_unit(comparison.rms3d_mm), in_unit(comparison.max_mm), unit.name)},
       {"Deviation over predicted sigma, rms",
        comparison.normalised_rms > 0.0 ? significant(comparison.normalised_rms, 3) : std::string("no sigma was given")}});
  const int decimals = decimals_for_column(sigmas, decimals_for_sigma(median(sizes), 3));
  HtmlTable table("After the fit of the points with ids. Sigmas are predicted from both sides and the fit.",
                  {{"Id", ""},
                   {"In the reference", ""},
                   {"dx", unit.name},
                   {"dy", unit.name},
                   {"dz", unit.name},
                   {"3D", unit.name},
                   {"sx", unit.name},
                   {"sy", unit.name},
                   {"sz", unit.name},
                   {"max d/s", ""}});
  table.limit_rows(kMaxRows, "deviations.csv");
  for (const Deviation& one : comparison.points) {
    std::vector<Cell> row = {number_cell(std::to_string(one.id), one.id),
                             number_cell(std::to_string(one.reference_id), one.reference_id)};
    double worst = 0.0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double value = one.deviation_mm(axis) * unit.per_mm;
      row.push_back(number_cell(fixed(value, decimals), value));
      if (one.sigma_mm(axis) > 0.0) worst = std::max(worst, std::abs(one.deviation_mm(axis)) / one.sigma_mm(axis));
    }
    const double size = one.deviation_mm.norm() * unit.per_mm;
    row.push_back(number_cell(fixed(size, decimals), size));
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double sigma = one.sigma_mm(axis) * unit.per_mm;
      row.push_back(number_cell(fixed(sigma, decimals), sigma));
    }
    row.push_back(number_cell(significant(worst, 3), worst, worst > kLargeNormalised ? "warning" : ""));
    table.add_row(std::move(row));
  }
  return text + table.html();
}

}  // namespace crosstie::report::detail
