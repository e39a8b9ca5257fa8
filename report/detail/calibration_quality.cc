#include "report/detail/calibration_quality.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/image_map.h"
#include "report/detail/number.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {
namespace {

using base::Calibration;
using base::CalibrationChange;
using base::CalibrationMaps;
using base::EpipolarPair;

constexpr double kLargeW = 3.29;  // 0.1 % two-sided

/// End of the colours: three times the median where something counts, so that the uncalibrated border does not drown the rest.
double colour_end(const Eigen::VectorXd& values, const std::vector<char>& counts) {
  const double p95 = base::map_figures(values, counts).p95;
  return std::isfinite(p95) ? 1.5 * p95 : 0.0;
}

std::string camera_maps(const base::ProjectionSigmas& map, const std::string& name) {
  return fmt::format("<h3>Camera {}</h3>\n", escape(name)) +
         figures(
             {figure(
                  image_map(map.grid, map.sigma_px, fmt::format("Sigma of a projection, camera {}", name), "sigma",
                            {.high = colour_end(map.sigma_px, map.calibrated)}),
                  "Standard deviation of where a point that stands still against the boards is seen, in its worst direction."),
              figure(image_map(map.grid, map.sigma_mm, fmt::format("The same on the object, camera {}", name), "sigma",
                               {.unit = "mm", .high = colour_end(map.sigma_mm, map.calibrated)}),
                     "Across the line of sight at the working distance.")});
}

std::string point_maps(const base::TriangulationSigmas& map, const std::string& title, const std::string& about) {
  return figures({figure(image_map(map.grid, map.sigma_depth_mm, title + ", along the ray", "sigma",
                                   {.unit = "mm", .high = colour_end(map.sigma_depth_mm, map.calibrated)}),
                         about),
                  figure(image_map(map.grid, map.sigma_across_mm, title + ", across", "sigma",
                                   {.unit = "mm", .high = colour_end(map.sigma_across_mm, map.calibrated)}),
                         "The larger one across the left camera's line of sight.")});
}

void add_figures(HtmlTable& table, const std::string& name, const Eigen::VectorXd& values, const std::vector<char>& counts,
                 const char* unit) {
  const base::MapFigures figures = base::map_figures(values, counts);
  table.add_row({text_cell(name), number_cell(significant(figures.median), figures.median),
                 number_cell(significant(2.0 * figures.median), 2.0 * figures.median),
                 number_cell(significant(figures.p95), figures.p95), number_cell(significant(figures.max), figures.max),
                 text_cell(unit)});
}

std::string figures_table(const Calibration& calibration, const CalibrationMaps& maps) {
  HtmlTable table("Over the calibrated cells.", {{"Sigma of", "", "", false},
                                                 {"Median", ""},
                                                 {"U", "", "k = 2, of the median"},
                                                 {"95 % below", ""},
                                                 {"Largest", ""},
                                                 {"Unit", "", "", false}});
  for (std::size_t c = 0; c < maps.cameras.size(); ++c) {
    const base::ProjectionSigmas& map = maps.cameras[c];
    const std::string& name = calibration.cameras.at(c).name;
    add_figures(table, fmt::format("a projection, camera {}", name), map.sigma_px, map.calibrated, "px");
    add_figures(table, fmt::format("the same on the object, camera {}", name), map.sigma_mm, map.calibrated, "mm");
  }
  for (const auto& [map, frame] : {std::pair{&maps.in_rig, "in the rig's frame"}, {&maps.on_boards, "against the boards"}}) {
    if (!*map) continue;
    add_figures(table, fmt::format("a point {}, along the ray", frame), (*map)->sigma_depth_mm, (*map)->calibrated, "mm");
    add_figures(table, fmt::format("a point {}, across", frame), (*map)->sigma_across_mm, (*map)->calibrated, "mm");
  }
  return table.html();
}

/// Length of the difference over its sigma; cells that did not count stay blank.
Eigen::VectorXd over_sigma(const base::ProjectionDifference& difference) {
  Eigen::VectorXd values = difference.difference_px.colwise().norm().transpose().cwiseQuotient(difference.sigma_px);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (!difference.compared[static_cast<std::size_t>(i)]) values(i) = std::nan("");
  }
  return values;
}

std::string lens_changes(const CalibrationChange& change) {
  HtmlTable table(
      fmt::format("Projections of each camera against the earlier model, at {} mm, after the motion of the camera's frame that "
                  "hides most of it.",
                  plain(change.distance_mm)),
      {{"Camera", "", "", false},
       {"Rms", "px"},
       {"Largest", "px"},
       {"Predicted rms", "px", "by both covariances, as independent"},
       {"Over it", ""},
       {"p", "", "of an rms at least as large without a change"}});
  std::vector<std::string> maps;
  for (const CalibrationChange::Lens& lens : change.cameras) {
    if (!lens.difference) {
      table.add_row(
          {text_cell(lens.name), text_cell(lens.failure, "prose"), text_cell(""), text_cell(""), text_cell(""), text_cell("")});
      continue;
    }
    const base::ProjectionDifference& difference = *lens.difference;
    std::vector<Cell> row = {text_cell(lens.name), number_cell(significant(difference.rms_px), difference.rms_px),
                             number_cell(significant(difference.max_px), difference.max_px)};
    if (difference.test) {
      const double ratio = difference.rms_px / difference.test->rms_sigma_px;
      row.push_back(number_cell(significant(difference.test->rms_sigma_px), difference.test->rms_sigma_px));
      row.push_back(number_cell(fixed(ratio, 2), ratio, difference.test->exceeded() ? "warning" : ""));
      row.push_back(number_cell(significant(difference.test->p, 2), difference.test->p));
      maps.push_back(
          figure(image_map(difference.grid, over_sigma(difference), fmt::format("Change over its sigma, camera {}", lens.name),
                           "change", {.unit = "sigmas"}),
                 "Length of the difference of the projections over its predicted sigma; neighbouring cells are correlated."));
    } else {
      row.insert(row.end(), 3, text_cell("\u2013"));
    }
    table.add_row(std::move(row));
  }
  return (table.empty() ? std::string() : table.html()) + (maps.empty() ? std::string() : figures(maps));
}

std::string rig_change(const CalibrationChange::Rig& rig) {
  HtmlTable table("right_from_left against the earlier one: small turns about and shifts along the right camera's axes.",
                  {{"Component", "", "", false},
                   {"Change", ""},
                   {"Sigma", ""},
                   {"U", "", "k = 2"},
                   {"Over sigma", ""},
                   {"Unit", "", "", false}});
  const auto row = [&table](const std::string& name, double value, double sigma, const char* unit) {
    const double w = sigma > 0.0 ? value / sigma : std::nan("");
    const int decimals = decimals_for_sigma(sigma, 4);
    table.add_row({text_cell(name), number_cell(fixed(value, decimals), value), number_cell(fixed(sigma, decimals), sigma),
                   number_cell(fixed(2.0 * sigma, decimals), 2.0 * sigma),
                   number_cell(fixed(w, 2), w, std::abs(w) > kLargeW ? "warning" : ""), text_cell(unit)});
  };
  row(fmt::format("baseline (was {} mm)", fixed(rig.baseline_before_mm, 3)), rig.baseline_change_mm, rig.baseline_sigma_mm,
      "mm");
  constexpr double kMrad = 1e3;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double unit = i < 3 ? kMrad : 1.0;
    row(fmt::format("{} {}", i < 3 ? "turn about" : "shift along", "xyzxyz"[i]), unit * rig.change(i), unit * rig.sigma(i),
        i < 3 ? "mrad" : "mm");
  }
  return table.html();
}

}  // namespace

std::string calibration_maps_section(const Calibration& calibration, const CalibrationMaps& maps) {
  std::string html = paragraph(
      fmt::format("What the joint covariance of lenses, rig and boards says of a point {} mm away, the working distance. "
                  "It is the calibration's part alone: the noise of a later measurement comes on top, and no number "
                  "of measurements averages it "
                  "away. Outside of the calibrated cells the lens model is extrapolated.",
                  plain(maps.distance_mm)));
  html += figures_table(calibration, maps);
  for (std::size_t c = 0; c < maps.cameras.size(); ++c) html += camera_maps(maps.cameras[c], calibration.cameras.at(c).name);
  if (maps.in_rig || maps.on_boards) html += "<h3>Points that both cameras see</h3>\n";
  if (maps.in_rig) {
    html += point_maps(*maps.in_rig, "Sigma of a point in the rig's frame",
                       "Along the left camera's line of sight, over the left image, in the frame of the left camera.");
  }
  if (maps.on_boards) {
    html += point_maps(*maps.on_boards, "Sigma of a point against the boards",
                       "The same against the boards: what is left where the frame is found through the same cameras, as by "
                       "commissioning.");
  }
  return html;
}

std::string calibration_epipolar_section(const std::vector<EpipolarPair>& pairs) {
  HtmlTable table(
      "Corners of each pair of images: distance of the right corner from the epipolar curve of the left one. The board's shape "
      "takes "
      "no part in it. Far above what is expected, something moved between the two exposures, or the rig is not rigid.",
      {{"Moment", "", "", false},
       {"Corners", ""},
       {"Mean", "px", "signed"},
       {"Rms", "px"},
       {"Expected", "px", "by the sigma of a corner in both images"},
       {"Over it", ""},
       {"Largest", "px"}});
  constexpr double kDoubtful = 2.0;
  double squares = 0.0;
  double expected = 0.0;
  for (const EpipolarPair& pair : pairs) {
    const double ratio = pair.rms_px / pair.expected_px;
    squares += pair.corners * pair.rms_px * pair.rms_px;
    expected += pair.corners * pair.expected_px * pair.expected_px;
    table.add_row({text_cell(pair.station), number_cell(std::to_string(pair.corners), pair.corners),
                   number_cell(fixed(pair.mean_px, 4), pair.mean_px), number_cell(fixed(pair.rms_px, 4), pair.rms_px),
                   number_cell(fixed(pair.expected_px, 4), pair.expected_px),
                   number_cell(fixed(ratio, 2), ratio, ratio > kDoubtful ? "warning" : ""),
                   number_cell(fixed(pair.max_px, 4), pair.max_px)});
  }
  int corners = 0;
  for (const EpipolarPair& pair : pairs) corners += pair.corners;
  const double n = std::max(1, corners);
  return paragraph(fmt::format("All pairs: {} px rms, {} px expected.", significant(std::sqrt(squares / n), 2),
                               significant(std::sqrt(expected / n), 2))) +
         table.html();
}

std::string calibration_change_section(const CalibrationChange& change) {
  std::string html =
      paragraph(fmt::format("Against {}. Both are taken as independent: calibrations that share images or the "
                            "board's shape should differ by less.",
                            change.previous));
  if (change.rig) html += rig_change(*change.rig);
  return html + lens_changes(change);
}

}  // namespace crosstie::report::detail
