#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;

/// sigma0 has the relative standard deviation 1 / sqrt(2 r) for r degrees of freedom.
double relative_sigma_of_sigma0(const AdjustedNetwork& network) {
  return network.redundancy > 0 ? 1.0 / std::sqrt(2.0 * network.redundancy) : 0.0;
}

/// The adjustment says so where it took the sigmas from the residuals themselves.
bool sigmas_were_adapted(const AdjustedNetwork& network) {
  return std::any_of(network.warnings.begin(), network.warnings.end(),
                     [](const base::Warning& warning) { return warning.code == "sigma_estimated"; });
}

KeyFigure coordinate_sigmas(const AdjustedNetwork& network) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const base::AdjustedPoint& point : network.points) sum += point.cov_mm2.diagonal();
  const Eigen::Vector3d sigma = (sum / std::max(1.0, static_cast<double>(network.points.size()))).cwiseSqrt();
  const std::vector<double> list = {sigma.x(), sigma.y(), sigma.z()};
  const LengthUnit unit = unit_for_lengths(list);
  const auto joined = [&](double factor) {
    return fmt::format("{} / {} / {} {}", significant(factor * unit.per_mm * sigma.x(), 2),
                       significant(factor * unit.per_mm * sigma.y(), 2), significant(factor * unit.per_mm * sigma.z(), 2),
                       unit.name);
  };
  return {"Sigma of a coordinate, x / y / z (rms)", joined(1.0), "U (k = 2): " + joined(2.0), ""};
}

KeyFigure weakest_point(const AdjustedNetwork& network) {
  const auto weakest = std::max_element(network.points.begin(), network.points.end(), [](const auto& a, const auto& b) {
    return largest_sigma(a.cov_mm2) < largest_sigma(b.cov_mm2);
  });
  const std::vector<double> sigma = {largest_sigma(weakest->cov_mm2)};
  const LengthUnit unit = unit_for_lengths(sigma);
  return {"Weakest point", fmt::format("{}: sigma {} {}", weakest->id, significant(sigma[0] * unit.per_mm, 2), unit.name),
          fmt::format("{} in its worst direction; {} rays", expanded(sigma[0] * unit.per_mm, unit.name), weakest->rays), ""};
}

std::string chi_square_sentence(const AdjustedNetwork& network) {
  if (network.redundancy <= 0) return "There is no redundancy: nothing tests the observations.";
  const double statistic = network.redundancy * network.sigma0 * network.sigma0;
  if (sigmas_were_adapted(network)) {
    return "The a priori sigmas were adapted to the residuals of this network (see the warnings): sigma0 is 1 by that, and its "
           "chi-square test says nothing.";
  }
  std::string text = fmt::format(
      "Chi-square test of sigma0: v'Pv = {} with {} degrees of freedom, expected {} \u00b1 {}; probability of a value at least "
      "this far "
      "off if the a priori sigmas are true: p = {}. ",
      significant(statistic, 6), counted(network.redundancy), counted(network.redundancy),
      significant(std::sqrt(2.0 * network.redundancy), 3), significant(network.chi2_p, 2));
  if (network.chi2_p >= 0.05) {
    text += "The test does not object (5 % level).";
  } else if (network.sigma0 > 1.0) {
    text +=
        "The test objects (5 % level): the residuals are larger than the detector's sigmas say, by wrong sigmas, a lens model "
        "that leaves something behind, or hidden blunders. All sigmas of this report are multiplied by sigma0.";
  } else {
    text +=
        "The test objects (5 % level): the residuals are smaller than the detector's sigmas say, so these are too cautious. "
        "All "
        "sigmas of this report are multiplied by sigma0.";
  }
  return text;
}

}  // namespace

std::vector<KeyFigure> bundle_key_figures(const AdjustedNetwork& network) {
  std::vector<KeyFigure> figures;
  const auto image_points = static_cast<long long>(network.residuals.size());
  if (!network.points.empty()) {
    figures.push_back(
        {"Points", counted(static_cast<long long>(network.points.size())),
         fmt::format("{} image points in {} images, {} per point", counted(image_points), network.images.size(),
                     significant(static_cast<double>(image_points) / static_cast<double>(network.points.size()), 3)),
         ""});
    figures.push_back(coordinate_sigmas(network));
    figures.push_back(weakest_point(network));
  }
  const double relative = relative_sigma_of_sigma0(network);
  figures.push_back(
      {"sigma0, a posteriori over a priori", with_sigma(network.sigma0, network.sigma0 * relative, ""),
       sigmas_were_adapted(network)
           ? "1 by adapting the a priori sigmas to the residuals"
           : fmt::format("{}; expected 1, p = {}", expanded(network.sigma0 * relative, ""), significant(network.chi2_p, 2)),
       network.redundancy > 0 && network.chi2_p < 0.05 ? "warning" : ""});
  figures.push_back(
      {"Image coordinate of unit weight", with_sigma(network.sigma0_px, network.sigma0_px * relative, "px"),
       fmt::format("{}; rms per point {} px", expanded(network.sigma0_px * relative, "px"), significant(network.rms_px)), ""});
  figures.push_back({"Redundancy", counted(network.redundancy),
                     fmt::format("n {} \u2212 u {} + {} conditions", counted(network.observations), counted(network.unknowns),
                                 network.conditions),
                     ""});
  const auto rejected = static_cast<double>(network.rejected.size());
  const double all = rejected + static_cast<double>(image_points);
  figures.push_back(
      {"Rejected image points", std::to_string(network.rejected.size()),
       fmt::format("{} % of {}", fixed(all > 0.0 ? 100.0 * rejected / all : 0.0, 2), counted(static_cast<long long>(all))),
       ""});
  if (network.uncoded.found > 0) {
    figures.push_back({"Uncoded targets", counted(network.uncoded.targets),
                       fmt::format("{} of {} dots without a readable code belong to them", counted(network.uncoded.matched),
                                   counted(network.uncoded.found)),
                       ""});
  }
  figures.push_back(
      {"Scale", network.scale,
       fmt::format("{} scale bar{} in the list below", network.scale_bars.size(), network.scale_bars.size() == 1 ? "" : "s"),
       ""});
  return figures;
}

std::string bundle_adjustment_section(const AdjustedNetwork& network) {
  return definition_list(
             {{"Datum", network.datum},
              {"Scale", network.scale},
              {"Observations n", counted(network.observations)},
              {"Unknowns u", counted(network.unknowns)},
              {"Conditions of the datum d", std::to_string(network.conditions)},
              {"Redundancy r = n \u2212 u + d", counted(network.redundancy)},
              {"sigma0 = sqrt(v'Pv / r)", with_sigma(network.sigma0, network.sigma0 * relative_sigma_of_sigma0(network), "")},
              {"Unit-weight image coordinate", fmt::format("{} px", significant(network.sigma0_px, 4))},
              {"Image residual, rms per point", fmt::format("{} px", significant(network.rms_px, 4))},
              {"Iterations", std::to_string(network.iterations)}}) +
         paragraph(chi_square_sentence(network)) +
         paragraph(
             "Sigmas are standard uncertainties (k = 1) and a posteriori, U is expanded with k = 2 (about 95 %). Coordinates "
             "of a "
             "free network and their sigmas hold in its stated datum; distances do not depend on it. Inner precision says "
             "nothing "
             "of what all images have in common: compare with a reference, or with check bars.",
             "muted");
}

std::string bundle_scale_section(const AdjustedNetwork& network) {
  if (network.scale_bars.empty()) return paragraph(fmt::format("No scale bar; the scale is: {}.", network.scale));
  std::vector<double> sigmas;
  for (const base::AdjustedScaleBar& bar : network.scale_bars) sigmas.push_back(bar.sigma_mm);
  const int decimals = decimals_for_column(sigmas, 4);
  HtmlTable table(
      "Known distances at the temperature of the photographs. Check bars tell nothing to the adjustment. w is the "
      "deviation over its own sigma, that of the bar included.",
      {{"Bar", "", "", false},
       {"Role", "", "", false},
       {"Known", "mm"},
       {"Sigma known", "mm"},
       {"Measured", "mm"},
       {"Sigma measured", "mm"},
       {"U", "mm", "expanded uncertainty of the measured length, k = 2"},
       {"Deviation", "mm"},
       {"Relative", "ppm"},
       {"w", ""},
       {"Certificate", "", "", false}});
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    const double known = bar.bar.length_at_temperature_mm();
    const double deviation = bar.measured_mm - known;
    const char* role = bar.bar.role == base::ScaleBarRole::kUsed    ? "used"
                       : bar.bar.role == base::ScaleBarRole::kCheck ? "check"
                                                                    : "defines the scale";
    table.add_row({text_cell(fmt::format("{}\u2013{}", bar.bar.id_a, bar.bar.id_b)), text_cell(role),
                   number_cell(fixed(known, decimals), known), number_cell(fixed(bar.bar.sigma_mm, decimals), bar.bar.sigma_mm),
                   number_cell(fixed(bar.measured_mm, decimals), bar.measured_mm),
                   number_cell(fixed(bar.sigma_mm, decimals), bar.sigma_mm),
                   number_cell(fixed(2.0 * bar.sigma_mm, decimals), 2.0 * bar.sigma_mm),
                   number_cell(fixed(deviation, decimals), deviation),
                   number_cell(fixed(known > 0.0 ? 1e6 * deviation / known : 0.0, 1), deviation / known),
                   number_cell(fixed(bar.w, 2), bar.w, std::abs(bar.w) > 3.0 ? "warning" : ""),
                   text_cell(bar.bar.certificate)});
  }
  return table.html();
}

std::string bundle_rejected_section(const AdjustedNetwork& network) {
  const std::string unmatched =
      network.uncoded.left.empty()
          ? std::string()
          : paragraph(
                fmt::format("{} dots without a readable code belong to no point: glare, holes, targets that fewer than three "
                            "images show. They stand in unmatched.csv.",
                            counted(static_cast<long long>(network.uncoded.left.size()))));
  if (network.rejected.empty()) return paragraph("No observation was rejected.") + unmatched;
  HtmlTable table(
      "Observations that took no part, with the reason. w is the standardised residual against the network without them.",
      {{"Image", "", "", false}, {"Id", ""}, {"Reason", "", "", false}, {"w", ""}});
  table.limit_rows(1000, "rejected.csv");
  for (const base::RejectedObservation& one : network.rejected) {
    table.add_row({text_cell(one.image), number_cell(std::to_string(one.id), one.id), text_cell(one.reason),
                   one.w != 0.0 ? number_cell(significant(one.w, 3), one.w) : text_cell("\u2013")});
  }
  return table.html() + unmatched;
}

}  // namespace crosstie::report::detail
