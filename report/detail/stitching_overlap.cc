#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Eigenvalues>

#include "report/detail/colour.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plot.h"
#include "report/detail/scene.h"
#include "report/detail/stitching_sections.h"

namespace crosstie::report::detail {
namespace {

using base::OverlapCell;
using base::StitchedOverlap;
using base::Stitching;
using Eigen::Vector3d;

/// Cells of all overlaps, spread out along the two directions in which they extend most.
std::string overlap_map(const Stitching& stitching) {
  std::vector<std::pair<const StitchedOverlap*, const OverlapCell*>> cells;
  Vector3d mean = Vector3d::Zero();
  for (const StitchedOverlap& overlap : stitching.overlaps) {
    for (const OverlapCell& cell : overlap.cells) {
      cells.emplace_back(&overlap, &cell);
      mean += cell.centre_mm;
    }
  }
  if (cells.size() < 3) return {};
  mean /= static_cast<double>(cells.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  std::vector<double> sizes;
  for (const auto& [overlap, cell] : cells) {
    moments += (cell->centre_mm - mean) * (cell->centre_mm - mean).transpose();
    sizes.push_back(std::abs(cell->difference_mm));
  }
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  Vector3d across = axes.col(2);
  Vector3d up = axes.col(1);
  Eigen::Index largest = 0;
  across.cwiseAbs().maxCoeff(&largest);
  if (across(largest) < 0.0) across = -across;
  up.cwiseAbs().maxCoeff(&largest);
  if (up(largest) < 0.0) up = -up;
  double low_x = std::numeric_limits<double>::infinity();
  double low_y = low_x;
  double high_x = -low_x;
  double high_y = -low_x;
  for (const auto& [overlap, cell] : cells) {
    const double x = across.dot(cell->centre_mm - mean);
    const double y = up.dot(cell->centre_mm - mean);
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
  }
  const LengthUnit unit = unit_for_lengths(sizes);
  const double range = *std::max_element(sizes.begin(), sizes.end());
  const double margin = 0.05 * std::max(high_x - low_x, high_y - low_y);
  Plot plot("Differences of overlapping surfaces", "First minus second station along the normal, mean of each cell",
            make_axis(low_x - margin, high_x + margin), make_axis(low_y - margin, high_y + margin), "along the row [mm]",
            "across [mm]", {.width_px = 760.0, .equal_scale = true});
  for (const auto& [overlap, cell] : cells) {
    const double share = range > 0.0 ? cell->difference_mm / range : 0.0;
    const auto name = [&](int k) { return stitching.stations[static_cast<std::size_t>(k)].name; };
    plot.point(across.dot(cell->centre_mm - mean), up.dot(cell->centre_mm - mean), "spot", diverging_colour(share),
               fmt::format("{} minus {}: {}", name(overlap->a), name(overlap->b),
                           with_sigma(cell->difference_mm * unit.per_mm, cell->sigma_mm * unit.per_mm, unit.name)),
               6.0);
  }
  return figure(
      plot.str(),
      fmt::format(
          "From \u2212{0} {1} (blue) over 0 (pale) to +{0} {1} (red); a tooltip tells each cell's difference and sigma.",
          significant(range * unit.per_mm, 2), unit.name),
      true);
}

}  // namespace

std::string stitching_overlap_section(const Stitching& stitching) {
  if (stitching.overlaps.empty()) return paragraph("No two surfaces overlap: the stations stand on markers and axis alone.");
  const auto name = [&](int k) { return stitching.stations[static_cast<std::size_t>(k)].name; };
  HtmlTable table(
      "Where two stations see the same surface: mean of their differences along the normal, its sigma before the adjustment, "
      "and the cells' "
      "differences over their sigmas (noise alone), which are near 1 where the surfaces agree.",
      {{"Stations", "", "", false},
       {"Pairs of pieces", ""},
       {"Mean", "mm"},
       {"Sigma", "mm"},
       {"Scatter of the pieces", "mm", "robust"},
       {"Over sigma", "", "rms of the cells"},
       {"Largest cell", "mm"},
       {"Does not tell", "", "directions in which this overlap takes no part", false}});
  for (const StitchedOverlap& overlap : stitching.overlaps) {
    double largest = 0.0;
    for (const OverlapCell& cell : overlap.cells) largest = std::max(largest, std::abs(cell.difference_mm));
    table.add_row({text_cell(fmt::format("{}, {}", name(overlap.a), name(overlap.b))),
                   number_cell(counted(overlap.matches), overlap.matches),
                   number_cell(fixed(overlap.mean_mm, 4), overlap.mean_mm),
                   number_cell(significant(overlap.sigma_mm, 2), overlap.sigma_mm),
                   number_cell(significant(overlap.rms_mm, 2), overlap.rms_mm),
                   number_cell(fixed(overlap.normalised, 2), overlap.normalised), number_cell(fixed(largest, 4), largest),
                   text_cell(fmt::format("{}", fmt::join(overlap.not_seen, ", ")))});
  }
  return table.html() + overlap_map(stitching);
}

std::string stitching_scene(const Stitching& stitching, const base::Cloud& merged) {
  constexpr std::size_t kMost = 200000;  // of the cloud: a browser opens them in less than two seconds
  const auto field = [&](const char* name) -> const std::vector<double>* {
    for (const base::CloudField& one : merged.fields) {
      if (one.name == name) return &one.values;
    }
    return nullptr;
  };
  const std::vector<double>* difference = field("difference");
  ShownCloud cloud;
  cloud.value = "stations differ by";
  cloud.unit = "sigmas";
  cloud.none = "seen by one station";
  cloud.sigma = "sigma in its worst direction";
  const std::size_t every = (merged.points.size() + kMost - 1) / kMost;
  for (std::size_t i = 0; i < merged.points.size(); i += every) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const double differs = difference != nullptr ? std::abs((*difference)[i]) : kNone;
    cloud.points.push_back({merged.points[i], differs > 0.0 ? differs : kNone,
                            i < merged.cov_mm2.size() ? largest_sigma(merged.cov_mm2[i]) : kNone});
  }
  std::vector<ShownPoint> shown;
  std::vector<double> sigmas;
  for (const base::StitchedMarker& marker : stitching.markers) {
    ShownPoint& point = shown.emplace_back();
    point.id = std::to_string(marker.id);
    point.xyz_mm = marker.xyz_mm;
    point.cov_mm2 = marker.cov_mm2;
    point.ring = true;
    sigmas.push_back(largest_sigma(marker.cov_mm2));
    point.about = {fmt::format("Marker {}", marker.id),
                   fmt::format("sigma {} mm in its worst direction", significant(sigmas.back(), 2))};
  }
  constexpr double kShown_mm = 20.0;  // length of a usual marker's semi-axis to begin with
  const double usual = sigmas.empty() ? 0.0 : median(sigmas);
  return points_scene(shown, "Stations differ [sigmas]", usual > 0.0 ? kShown_mm / usual : 1.0, cloud, "markers");
}

}  // namespace crosstie::report::detail
