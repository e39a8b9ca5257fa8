#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {

double relative_sigma_of_sigma0(const base::AdjustedNetwork& network) {
  return network.redundancy > 0 ? 1.0 / std::sqrt(2.0 * network.redundancy) : 0.0;
}

bool sigmas_were_adapted(const base::AdjustedNetwork& network) {
  return std::any_of(network.warnings.begin(), network.warnings.end(),
                     [](const base::Warning& warning) { return warning.code == "sigma_estimated"; });
}

namespace {

using base::AdjustedNetwork;

std::string chi_square_sentence(const AdjustedNetwork& network) {
  if (network.redundancy <= 0) return "There is no redundancy: nothing tests the observations.";
  const double statistic = network.redundancy * network.sigma0 * network.sigma0;
  if (sigmas_were_adapted(network) || network.variance_components_applied) {
    return "The a priori sigmas were adapted to the residuals of this network (see the warnings): sigma0 is 1 by that, and its "
           "chi-square test says nothing.";
  }
  std::string text = fmt::format(
      "Chi-square test of sigma0: v'Pv = {} with {} degrees of freedom, expected {} \u00b1 {}; probability of a value at least "
      "this far "
      "off if the a priori sigmas are true: p {}. ",
      significant(statistic, 6), counted(network.redundancy), counted(network.redundancy),
      significant(std::sqrt(2.0 * network.redundancy), 3), probability(network.chi2_p));
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

/// What the frame of the coordinates is, in words.
std::string datum_sentence(const AdjustedNetwork& network) {
  if (network.conditions == 0) {
    return "Fixed: the control points give position, orientation and scale; their uncertainty is part of every sigma.";
  }
  const bool defined = network.conditions == 7 && network.scale.starts_with("defined by");
  const std::string free = network.conditions != 7 ? "3 shifts and 3 rotations" : "3 shifts, 3 rotations and the scale";
  const std::string scale = defined ? fmt::format(" The scale is {}, which is exact.", network.scale) : "";
  if (network.datum.starts_with("minimal")) {
    return fmt::format(
        "Minimally fixed: as many coordinates are held as the observations leave open ({}). Sigmas are small near these points "
        "and grow away from them.{}",
        free, scale);
  }
  if (network.datum.find("datum points") != std::string::npos) {
    return fmt::format(
        "Free, laid onto given coordinates: the observations leave {} open; the frame is the best fit to the datum points, "
        "whose given coordinates are not observed and bend nothing.{}",
        free, scale);
  }
  return fmt::format(
      "Free: the observations leave {} open; inner constraints over all points fix the frame, so that no point is preferred "
      "and the sum of all variances is the least of all such frames. The origin is the middle of the coded points, the axes "
      "are their main directions.{}",
      free, scale);
}

std::string balance_table(const AdjustedNetwork& network) {
  HtmlTable table("Observations, unknowns and what is left to check them by.",
                  {{"Kind", "", "", false}, {"Number", ""}, {"What", "", "", false}});
  const auto row = [&](const char* kind, const char* what, int number, bool always = false) {
    if (number != 0 || always)
      table.add_row({text_cell(kind), number_cell(counted(number), static_cast<double>(number)), text_cell(what)});
  };
  const base::ObservationCounts& observed = network.observed;
  row("Image points (IP)", "coordinates in images, two of each point", observed.image_coordinates, true);
  row("Scale bars", "lengths with role used", observed.scale_bars);
  row("Control points (CP)", "given coordinates", observed.control_coordinates);
  row("Lenses", "parameters known beforehand", observed.lens_parameters);
  row("Observations", "n", network.observations, true);
  const base::UnknownCounts& estimated = network.estimated;
  row("Interior orientation (IO)", "lens parameters", estimated.interior, true);
  row("Exterior orientation (EO)", "6 of each image, or of each station of a rig", estimated.exterior, true);
  row("Rigs", "6 of each camera but the first", estimated.rig);
  row("Object points (OP)", "coordinates of points", estimated.object, true);
  row("Unknowns", "u", network.unknowns, true);
  row("Datum", "conditions d", network.conditions, true);
  row("Redundancy", "r = n \u2212 u + d", network.redundancy, true);
  return table.html();
}

std::string rank_list(const AdjustedNetwork& network) {
  if (network.structural_rank == 0) return "";
  const double worse = network.least_eigenvalue > 0.0 ? 1.0 / std::sqrt(network.least_eigenvalue) : 0.0;
  return "<h3>Is everything determined?</h3>\n" +
         definition_list(
             {{"Structural rank",
               fmt::format("{} of {} unknowns", counted(network.structural_rank), counted(network.unknowns))},
              {"Numerical rank",
               fmt::format("{} = u \u2212 {} of the datum", counted(network.rank), network.unknowns - network.rank)},
              {"Least eigenvalue", significant(network.least_eigenvalue, 3)},
              {"Termination", fmt::format("converged after {} iterations", network.iterations)},
              {"Last step", fmt::format("{} sigma, all image points together", significant(network.last_step, 2))}}) +
         paragraph(
             network.structural_rank < network.unknowns
                 ? "Something is observed less often than it has unknowns, whatever the geometry."
                 : fmt::format(
                       "Weakest combination of unknowns: {}. It is known {} times worse than each of them would be alone (the "
                       "inverse root of the least eigenvalue of the reduced normal matrix, scaled to a unit diagonal); from "
                       "100 000 on the adjustment is refused.",
                       network.weakest.empty() ? std::string("none stands out") : network.weakest, significant(worse, 3)));
}

}  // namespace

std::string bundle_adjustment_section(const AdjustedNetwork& network) {
  return definition_list({{"Datum", network.datum},
                          {"Scale", network.scale},
                          {"sigma0 a priori", "1"},
                          {"sigma0 a posteriori = sqrt(v'Pv / r)",
                           with_sigma(network.sigma0, network.sigma0 * relative_sigma_of_sigma0(network), "")},
                          {"Unit-weight image coordinate", fmt::format("{} px", significant(network.sigma0_px, 4))},
                          {"Image residual, rms per point", fmt::format("{} px", significant(network.rms_px, 4))}}) +
         paragraph(datum_sentence(network)) + paragraph(chi_square_sentence(network)) + balance_table(network) +
         rank_list(network) +
         paragraph(
             "Sigmas are standard uncertainties (k = 1) and a posteriori, U is expanded with k = 2 (about 95 %). Coordinates "
             "of a free network and their sigmas hold in its stated datum; distances do not depend on it. Inner precision says "
             "nothing of what all images have in common: compare with a reference, or with check bars.",
             "muted");
}

std::string bundle_components_section(const AdjustedNetwork& network) {
  constexpr double kUnlikely = 0.001;
  HtmlTable table(
      "Estimated over stated sigma of each group of observations, all groups together (restricted maximum likelihood): 1 where "
      "the "
      "stated sigmas are true. p: probability of a ratio at least this far from 1 if they are.",
      {{"Group", "", "", false},
       {"Observations", ""},
       {"Redundancy", ""},
       {"Ratio", ""},
       {"Sigma", ""},
       {"95 % from", ""},
       {"to", ""},
       {"p", ""}});
  for (const base::VarianceComponent& of : network.variance_components) {
    std::vector<Cell> row = {text_cell(of.group), number_cell(counted(of.observations), of.observations),
                             number_cell(significant(of.redundancy, 4), of.redundancy)};
    if (of.estimated) {
      row.push_back(number_cell(significant(of.sigma_ratio, 3), of.sigma_ratio, of.p < kUnlikely ? "warning" : ""));
      row.push_back(number_cell(significant(of.sigma, 2), of.sigma));
      row.push_back(number_cell(significant(of.low, 3), of.low));
      row.push_back(number_cell(significant(of.high, 3), of.high));
      row.push_back(number_cell(significant(of.p, 2), of.p));
    } else {
      for (int k = 0; k < 5; ++k) row.push_back(text_cell("not told"));
    }
    table.add_row(std::move(row));
  }
  std::string text =
      network.variance_components_applied
          ? "The sigmas of each group were multiplied by its ratio, which makes sigma0 1 by construction."
          : "The ratios are told, the stated sigmas were used, and all covariances are multiplied by sigma0 alone.";
  if (sigmas_were_adapted(network))
    text += " A common part was added to the detector's sigmas, so that the ratios of image points are those to that.";
  return paragraph(text) + table.html();
}

}  // namespace crosstie::report::detail
