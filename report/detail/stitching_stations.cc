#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"
#include "report/detail/stitching_sections.h"

namespace crosstie::report::detail {
namespace {

using base::DirectionKnowledge;
using base::StitchedStation;
using base::Stitching;

constexpr double kMilli = 1e3;

/// "mm" or "mrad" for people.
double shown(const DirectionKnowledge& direction) { return direction.angle ? kMilli * direction.sigma : direction.sigma; }
const char* unit_of(const DirectionKnowledge& direction) { return direction.angle ? "mrad" : "mm"; }

struct Worst {
  double sigma = 0.0;
  std::string direction;
  std::string station;
};

Worst worst_of(const Stitching& stitching, bool angle) {
  Worst worst;
  for (const StitchedStation& station : stitching.stations) {
    for (const DirectionKnowledge& direction : station.directions) {
      if (direction.angle != angle || direction.sigma <= worst.sigma) continue;
      worst = {direction.sigma, direction.name, station.name};
    }
  }
  return worst;
}

std::string percent(double share) { return share < 0.0005 ? "0" : fixed(100.0 * share, 1); }

std::string shape_text(const base::Segment& segment) {
  switch (segment.kind) {
    case base::Segment::Kind::kCylinder:
      return fmt::format("a cylinder of radius {} mm", fixed(segment.radius_mm, 1));
    case base::Segment::Kind::kCone:
      return fmt::format("a cone of half angle {} degrees, radius {} mm", fixed(segment.half_angle_rad * 57.29577951308232, 3),
                         fixed(segment.radius_mm, 1));
    case base::Segment::Kind::kPlane:
      return "a plane";
    case base::Segment::Kind::kNone:
      break;
  }
  return "no simple shape: directions are those of the frame";
}

}  // namespace

std::vector<KeyFigure> stitching_key_figures(const Stitching& stitching, std::size_t merged_points) {
  const Worst shift = worst_of(stitching, false);
  const Worst turn = worst_of(stitching, true);
  std::vector<KeyFigure> figures = {
      {"Stations", std::to_string(stitching.stations.size()), "frame: " + stitching.frame, ""},
      {"Least known shift", fmt::format("{} mm", significant(shift.sigma, 2)),
       fmt::format("{}; {} of {}", expanded(shift.sigma, "mm"), shift.direction, shift.station), ""},
      {"Least known turn", fmt::format("{} mrad", significant(kMilli * turn.sigma, 2)),
       fmt::format("{}; {} of {}", expanded(kMilli * turn.sigma, "mrad"), turn.direction, turn.station), ""}};
  double worst = 0.0;
  double largest = 0.0;
  for (const base::StitchedOverlap& overlap : stitching.overlaps) {
    worst = std::max(worst, overlap.normalised);
    for (const base::OverlapCell& cell : overlap.cells) largest = std::max(largest, std::abs(cell.difference_mm));
  }
  if (!stitching.overlaps.empty()) {
    figures.push_back({"Largest step of a seam", fmt::format("{} mm", significant(largest, 2)),
                       fmt::format("{} overlaps; differences over sigma up to {}", stitching.overlaps.size(), fixed(worst, 2)),
                       ""});
  }
  figures.push_back({"Markers", std::to_string(stitching.markers.size()),
                     fmt::format("{} left out; squared residuals over expected {}", stitching.rejected.size(),
                                 fixed(stitching.marker_ratio, 2)),
                     stitching.rejected.empty() ? "" : "warning"});
  figures.push_back({"Rounds of matching (ICP)", std::to_string(stitching.iterations.size()),
                     fmt::format("pieces are worth {} % independent ones", fixed(100.0 * stitching.independent_share, 0)), ""});
  if (merged_points > 0)
    figures.push_back(
        {"Merged points", counted(static_cast<long long>(merged_points)), "with covariance, noise and shared part", ""});
  figures.push_back({"Redundancy", counted(stitching.redundancy),
                     fmt::format("n {} \u2212 u {}", counted(stitching.observations), counted(stitching.unknowns)), ""});
  return figures;
}

std::string stitching_stations_section(const Stitching& stitching) {
  std::string html =
      paragraph(fmt::format("The part is {}. Sigmas are of the middle of each station's cloud, and of turns about it.",
                            shape_text(stitching.segment)));
  if (stitching.stations.empty()) return html;
  std::vector<Column> columns = {{"Station", "", "", false}, {"Axis", "mm"}, {"x", "mm"}, {"y", "mm"}, {"z", "mm"}};
  for (const DirectionKnowledge& direction : stitching.stations.front().directions)
    columns.push_back({direction.name, unit_of(direction), "sigma"});
  columns.push_back({"Markers", "", "that took part"});
  columns.push_back({"Points", ""});
  columns.push_back({"Off axis, w", "", "standardised deviation from the commissioned axis; 1 is expected"});
  HtmlTable table("Middle of each station's cloud in the frame, and the sigma of its place in each direction.", columns);
  for (const StitchedStation& station : stitching.stations) {
    std::vector<Cell> cells = {text_cell(station.name),
                               station.axis_mm ? number_cell(fixed(*station.axis_mm, 3), *station.axis_mm) : text_cell("")};
    for (Eigen::Index i = 0; i < 3; ++i) cells.push_back(number_cell(fixed(station.centre_mm(i), 3), station.centre_mm(i)));
    for (const DirectionKnowledge& direction : station.directions)
      cells.push_back(number_cell(significant(shown(direction), 2), direction.sigma));
    cells.push_back(number_cell(std::to_string(station.markers), station.markers));
    cells.push_back(number_cell(counted(station.points), static_cast<double>(station.points)));
    cells.push_back(station.off_axis ? number_cell(fixed(station.off_axis_w, 2), station.off_axis_w) : text_cell(""));
    table.add_row(std::move(cells), anchor("s-", station.name));
  }
  return html + table.html();
}

std::string stitching_sources_section(const Stitching& stitching) {
  HtmlTable table(
      "Share of each direction's variance that stems from each source, percent. Where sources tell a direction side by side it "
      "is their share of "
      "the information. A source that does not see a direction may still help by turns that it holds.",
      {{"Station", "", "", false},
       {"Direction", "", "", false},
       {"Sigma", ""},
       {"U (k = 2)", ""},
       {"Unit", "", "", false},
       {"Markers", "%", "what the stations saw of them"},
       {"Reference", "%", "the list of their coordinates"},
       {"Axis", "%", "the commissioned frame, readings and stops"},
       {"Surface", "%", "overlaps"},
       {"Calibration", "%", "of the head: one block for all stations"}});
  for (const StitchedStation& station : stitching.stations) {
    for (const DirectionKnowledge& direction : station.directions) {
      std::vector<Cell> cells = {
          text_cell(station.name), text_cell(direction.name), number_cell(significant(shown(direction), 2), direction.sigma),
          number_cell(significant(2.0 * shown(direction), 2), direction.sigma), text_cell(unit_of(direction))};
      const base::SourceShares& share = direction.share;
      for (const double value : {share.markers, share.reference, share.axis, share.surface, share.calibration}) {
        cells.push_back(number_cell(percent(value), value, value < 0.0005 ? "muted" : ""));
      }
      table.add_row(std::move(cells));
    }
  }
  return table.html();
}

std::string stitching_drift_section(const Stitching& stitching) {
  HtmlTable table(
      "Sigmas of each station's place as the first one of the row sees it; and what they would be if neither reference "
      "coordinates nor the axis "
      "held the row, so that markers and overlaps alone carried it from scan to scan.",
      {{"Station", "", "", false},
       {"Distance", "mm"},
       {"Axial", "mm", "or the segment's first direction"},
       {"Tangential", "mm"},
       {"Radial", "mm"},
       {"Axial, free", "mm"},
       {"Tangential, free", "mm"},
       {"Radial, free", "mm"}});
  for (const base::StitchDrift& drift : stitching.drift) {
    std::vector<Cell> cells = {text_cell(stitching.stations[static_cast<std::size_t>(drift.to)].name),
                               number_cell(fixed(drift.distance_mm, 0), drift.distance_mm)};
    for (Eigen::Index i = 0; i < 3; ++i) cells.push_back(number_cell(significant(drift.sigma_mm(i), 2), drift.sigma_mm(i)));
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double value = drift.free_sigma_mm(i);
      cells.push_back(std::isfinite(value) ? number_cell(significant(value, 2), value) : text_cell("not joined", "muted"));
    }
    table.add_row(std::move(cells));
  }
  return table.html();
}

std::string stitching_markers_section(const Stitching& stitching) {
  HtmlTable table("Markers in the frame.", {{"Id", "", "", false},
                                            {"x", "mm"},
                                            {"y", "mm"},
                                            {"z", "mm"},
                                            {"Sigma", "mm", "largest semi-axis"},
                                            {"Stations", "", "that saw it"},
                                            {"w", "", "largest standardised residual; 1 is expected"},
                                            {"Off the list", "mm", "adjusted minus given"}});
  for (const base::StitchedMarker& marker : stitching.markers) {
    const double sigma = largest_sigma(marker.cov_mm2);
    const double off = marker.reference_residual_mm.norm();
    table.add_row({text_cell(std::to_string(marker.id)), number_cell(fixed(marker.xyz_mm.x(), 3), marker.xyz_mm.x()),
                   number_cell(fixed(marker.xyz_mm.y(), 3), marker.xyz_mm.y()),
                   number_cell(fixed(marker.xyz_mm.z(), 3), marker.xyz_mm.z()), number_cell(significant(sigma, 2), sigma),
                   number_cell(std::to_string(marker.stations.size()), static_cast<double>(marker.stations.size())),
                   number_cell(fixed(marker.max_w, 2), marker.max_w),
                   marker.in_reference ? number_cell(fixed(off, 3), off) : text_cell("")});
  }
  table.limit_rows(300, "markers.csv");
  std::string html = table.html();
  if (stitching.rejected.empty()) return html + paragraph("No sighting was left out.");
  HtmlTable out("Sightings and places of the list that took no part.",
                {{"Where", "", "", false}, {"Id", ""}, {"Off", "mm"}, {"w", ""}, {"Why", "", "", false}});
  for (const base::RejectedSighting& one : stitching.rejected) {
    out.add_row({text_cell(one.station < 0 ? "list" : stitching.stations[static_cast<std::size_t>(one.station)].name),
                 number_cell(std::to_string(one.id), one.id), number_cell(fixed(one.distance_mm, 3), one.distance_mm),
                 one.w > 0.0 ? number_cell(fixed(one.w, 1), one.w) : text_cell(""), text_cell(one.reason)});
  }
  return html + out.html();
}

std::string stitching_matching_section(const Stitching& stitching) {
  std::string html = paragraph(
      "Surfaces are matched piece by piece to the nearest piece of the other station, and anew after every step of the "
      "adjustment: this loop is the "
      "iterative closest point method (ICP). It stands inside of the one adjustment with markers, list and axis, so what no "
      "surface sees cannot slide.");
  HtmlTable table("Rounds.", {{"Round", "", "", false},
                              {"Pairs of pieces", ""},
                              {"Moved", "mm", "largest move of a station"},
                              {"Differences, rms", "mm", "robust"}});
  for (std::size_t i = 0; i < stitching.iterations.size(); ++i) {
    const base::StitchIteration& iteration = stitching.iterations[i];
    table.add_row({text_cell(std::to_string(i + 1)), number_cell(counted(iteration.matches), iteration.matches),
                   number_cell(significant(iteration.moved_mm, 2), iteration.moved_mm),
                   number_cell(significant(iteration.rms_mm, 2), iteration.rms_mm)});
  }
  html += table.html();
  return html +
         definition_list({{"Scatter of the pieces over their stated sigma", fixed(stitching.surface_factor, 2)},
                          {"Independent pieces, of all", fmt::format("{} %", fixed(100.0 * stitching.independent_share, 0))},
                          {"Change of the head's calibration, in its sigmas", fixed(stitching.calibration_shift, 2)},
                          {"Sightings, squared residuals over expected", fixed(stitching.marker_ratio, 2)},
                          {"List, squared residuals over expected", fixed(stitching.reference_ratio, 2)}});
}

}  // namespace crosstie::report::detail
