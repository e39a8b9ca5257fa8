#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/charts.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plan_view.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report::detail {
namespace {

using base::Deviation;
using base::Verification;

constexpr std::size_t kMaxRows = 3000;
constexpr double kLargeNormalised = 3.29;  // 0.1 % two-sided

std::vector<PlanPoint> deviation_points(const Verification& verification) {
  std::vector<PlanPoint> points;
  for (const Deviation& one : verification.points) {
    points.push_back({one.id, one.reference_mm, Eigen::Matrix3d(one.sigma_mm.cwiseAbs2().asDiagonal()), one.deviation_mm,
                      fmt::format("point {}: {} {} {} mm", one.id, significant(one.deviation_mm.x()),
                                  significant(one.deviation_mm.y()), significant(one.deviation_mm.z()))});
  }
  return points;
}

LengthUnit deviation_unit(const Verification& verification) {
  std::vector<double> sizes;
  for (const Deviation& one : verification.points) sizes.push_back(one.deviation_mm.norm());
  return unit_for_lengths(sizes);
}

struct Statistics {
  double mean = 0.0;
  double deviation = 0.0;
  double rms = 0.0;
  double largest = 0.0;
};

Statistics statistics(const std::vector<double>& values) {
  Statistics result;
  const double count = static_cast<double>(values.size());
  if (values.empty()) return result;
  double square_sum = 0.0;
  for (const double value : values) {
    result.mean += value / count;
    square_sum += value * value;
    if (std::abs(value) > std::abs(result.largest)) result.largest = value;
  }
  double scatter = 0.0;
  for (const double value : values) scatter += (value - result.mean) * (value - result.mean);
  result.rms = std::sqrt(square_sum / count);
  result.deviation = values.size() > 1 ? std::sqrt(scatter / (count - 1.0)) : 0.0;
  return result;
}

void add_statistics(HtmlTable& table, const std::string& what, const Verification& verification, bool used_only,
                    Eigen::Vector3d Deviation::*field, const LengthUnit& unit) {
  std::array<std::vector<double>, 4> values;
  for (const Deviation& one : verification.points) {
    if (used_only && !one.used) continue;
    for (std::size_t axis = 0; axis < 3; ++axis)
      values[axis].push_back((one.*field)(static_cast<Eigen::Index>(axis)) * unit.per_mm);
    values[3].push_back((one.*field).norm() * unit.per_mm);
  }
  static constexpr std::array<const char*, 4> kNames = {"x", "y", "z", "3D"};
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const Statistics s = statistics(values[axis]);
    const bool narrow = s.deviation > 0.0 && s.deviation < s.rms;
    const int decimals = decimals_for_sigma((narrow ? s.deviation : s.rms) / 10.0);  // three digits of the smaller
    const auto cell = [&](double value) { return number_cell(fixed(value, decimals), value); };
    table.add_row({text_cell(fmt::format("{}, {}", what, kNames[axis])),
                   number_cell(std::to_string(values[axis].size()), static_cast<double>(values[axis].size())), cell(s.mean),
                   cell(s.deviation), cell(s.rms), cell(s.largest)});
  }
}

}  // namespace

double deviation_magnification(const Verification& verification) {
  std::vector<double> sizes;
  for (const Deviation& one : verification.points) sizes.push_back(one.deviation_mm.norm());
  return plan_magnification(deviation_points(verification), median(sizes));
}

std::string verification_plan_section(const Verification& verification) {
  const std::vector<PlanPoint> points = deviation_points(verification);
  const double magnification = deviation_magnification(verification);
  std::vector<std::string> list;
  for (const auto& [horizontal, vertical] : plan_axes(points)) {
    const std::string name = fmt::format("{}{}", "xyz"[horizontal], "xyz"[vertical]);
    list.push_back(
        figure(plan_view(points, fmt::format("Deviations in {}", name),
                         {.horizontal = horizontal, .vertical = vertical, .arrows = true, .magnification = magnification}),
               fmt::format("Deviations after the fit, measured minus reference, with the predicted one-sigma ellipses, both "
                           "magnified {} times.",
                           significant(magnification, 2))));
  }
  return figures(list);
}

std::string verification_statistics_section(const Verification& verification) {
  if (verification.points.empty()) return paragraph("There is no common point.");
  const LengthUnit unit = deviation_unit(verification);
  const auto columns = [](const char* in) {
    return std::vector<Column>{
        {"Deviation", "", "", false}, {"Count", ""}, {"Mean", in}, {"std", in}, {"rms", in}, {"max", in}};
  };
  HtmlTable table("After the fit, measured minus reference. std is about the mean, rms about zero, max the largest by amount.",
                  columns(unit.name));
  add_statistics(table, "In the fit", verification, true, &Deviation::deviation_mm, unit);
  const bool excluded =
      std::any_of(verification.points.begin(), verification.points.end(), [](const Deviation& d) { return !d.used; });
  if (excluded) add_statistics(table, "All points", verification, false, &Deviation::deviation_mm, unit);
  HtmlTable plain("Untransformed: the coordinates as they stand, in which a fit can hide nothing.", columns("mm"));
  add_statistics(plain, "As they stand", verification, true, &Deviation::untransformed_mm, LengthUnit());

  std::vector<double> deviations;
  std::vector<double> normalised;
  for (const Deviation& one : verification.points) {
    for (Eigen::Index axis = 0; one.used && axis < 3; ++axis) {
      deviations.push_back(one.deviation_mm(axis) * unit.per_mm);
      if (one.sigma_mm(axis) > 0.0) normalised.push_back(one.deviation_mm(axis) / one.sigma_mm(axis));
    }
  }
  const double rms = statistics(deviations).rms;
  std::vector<std::string> list = {
      figure(histogram(deviations, "Deviations per coordinate", fmt::format("deviation [{}]", unit.name),
                       {{rms, fmt::format("normal, sigma {} {}", significant(rms, 2), unit.name)}}),
             "All coordinates of the points in the fit.")};
  if (!normalised.empty()) {
    list.push_back(
        figure(histogram(normalised, "Normalised deviations", "deviation over predicted sigma", {{1.0, "as predicted"}}),
               fmt::format("Root mean square {}: 1 where the sigmas of both sides are true.",
                           significant(verification.normalised_rms, 3))));
  }
  return table.html() + plain.html() + figures(list);
}

std::string verification_points_section(const Verification& verification) {
  if (verification.points.empty()) return paragraph("There is no common point.");
  const LengthUnit unit = deviation_unit(verification);
  std::vector<double> sigmas;
  for (const Deviation& one : verification.points) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) sigmas.push_back(one.sigma_mm(axis) * unit.per_mm);
  }
  std::vector<double> sizes;
  for (const Deviation& one : verification.points) sizes.push_back(one.deviation_mm.norm() * unit.per_mm);
  const int decimals = decimals_for_column(sigmas, decimals_for_sigma(median(sizes), 3));
  const int coordinate_decimals = std::min(9, decimals + (unit.per_mm > 1.0 ? 3 : 0));
  HtmlTable fitted(
      fmt::format("After the fit. Sigmas are predicted from both sides and the fit; U is that of the 3D deviation (k = 2). "
                  "Marked: a coordinate beyond {} sigmas.",
                  kLargeNormalised),
      {{"Id", ""},
       {"Reference x", "mm"},
       {"Reference y", "mm"},
       {"Reference z", "mm"},
       {"dx", unit.name},
       {"dy", unit.name},
       {"dz", unit.name},
       {"3D", unit.name},
       {"sx", unit.name},
       {"sy", unit.name},
       {"sz", unit.name},
       {"U", unit.name, "k = 2"},
       {"max d/s", ""},
       {"Fit", "", "", false}});
  HtmlTable plain("As they stand, measured minus reference without any transformation.",
                  {{"Id", ""}, {"dx", "mm"}, {"dy", "mm"}, {"dz", "mm"}, {"3D", "mm"}});
  fitted.limit_rows(kMaxRows, "deviations.csv");
  plain.limit_rows(kMaxRows, "deviations.csv");
  for (const Deviation& one : verification.points) {
    std::vector<Cell> row = {number_cell(std::to_string(one.id), one.id)};
    std::vector<Cell> plain_row = row;
    double worst = 0.0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      row.push_back(number_cell(fixed(one.reference_mm(axis), coordinate_decimals), one.reference_mm(axis)));
      plain_row.push_back(number_cell(fixed(one.untransformed_mm(axis), coordinate_decimals), one.untransformed_mm(axis)));
      if (one.sigma_mm(axis) > 0.0) worst = std::max(worst, std::abs(one.deviation_mm(axis)) / one.sigma_mm(axis));
    }
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double value = one.deviation_mm(axis) * unit.per_mm;
      row.push_back(number_cell(fixed(value, decimals), value));
    }
    const double size = one.deviation_mm.norm() * unit.per_mm;
    row.push_back(number_cell(fixed(size, decimals), size));
    const bool known = one.sigma_mm.norm() > 0.0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double sigma = one.sigma_mm(axis) * unit.per_mm;
      row.push_back(known ? number_cell(fixed(sigma, decimals), sigma) : text_cell("\u2013"));
    }
    row.push_back(known ? number_cell(fixed(2.0 * one.sigma_mm.norm() * unit.per_mm, decimals), one.sigma_mm.norm())
                        : text_cell("\u2013"));
    row.push_back(known ? number_cell(fixed(worst, 2), worst, worst > kLargeNormalised ? "warning" : "") : text_cell("\u2013"));
    row.push_back(text_cell(one.used ? "used" : "left out", one.used ? "" : "muted"));
    fitted.add_row(std::move(row), fmt::format("p-{}", one.id));
    plain_row.push_back(number_cell(fixed(one.untransformed_mm.norm(), coordinate_decimals), one.untransformed_mm.norm()));
    plain.add_row(std::move(plain_row));
  }
  return "<h3>After the fit</h3>\n" + fitted.html() + "<h3>Untransformed</h3>\n" + plain.html();
}

}  // namespace crosstie::report::detail
