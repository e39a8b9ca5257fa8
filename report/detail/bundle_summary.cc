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
  figures.push_back({"sigma0, a posteriori over a priori", with_sigma(network.sigma0, network.sigma0 * relative, ""),
                     sigmas_were_adapted(network) ? "1 by adapting the a priori sigmas to the residuals"
                                                  : fmt::format("{}; expected 1, p {}", expanded(network.sigma0 * relative, ""),
                                                                probability(network.chi2_p)),
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

}  // namespace crosstie::report::detail
