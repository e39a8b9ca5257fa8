#include "report/scan_report.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/charts.h"
#include "report/detail/heat_map.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/page.h"
#include "report/detail/plot.h"
#include "report/detail/scene.h"

namespace crosstie::report {
namespace {

using base::PhaseStatus;
using base::ScannedCamera;
using base::ScanSummary;
using detail::number_cell;
using detail::text_cell;

std::int64_t count(const ScannedCamera& camera, PhaseStatus status) { return camera.counts[static_cast<std::size_t>(status)]; }

std::vector<detail::KeyFigure> key_figures(const ScanSummary& scan) {
  std::vector<detail::KeyFigure> figures = {
      {"Points", detail::counted(scan.points),
       fmt::format("{:.1f} % of the left camera's pixels",
                   100.0 * static_cast<double>(scan.points) / (1.0 * scan.width * scan.height)),
       ""},
      {"Sigma of a point (median)", fmt::format("{} mm", detail::significant(scan.sigma_mm, 2)),
       fmt::format("{}, noise along the viewing ray; 95 % below {} mm", detail::expanded(scan.sigma_mm, "mm"),
                   detail::significant(scan.sigma_p95_mm, 2)),
       ""},
      {"Depth", fmt::format("{} to {} mm", detail::fixed(scan.depth_min_mm, 0), detail::fixed(scan.depth_max_mm, 0)),
       "from the left camera", ""}};
  if (scan.calibration_mm) {
    figures.push_back(
        {"Calibration's part (median)", fmt::format("{} mm", detail::significant(*scan.calibration_mm, 2)),
         fmt::format("{}, shared by all points: no averaging makes it smaller", detail::expanded(*scan.calibration_mm, "mm")),
         ""});
  } else {
    figures.push_back({"Calibration's part", "unknown", "the calibration was given without its covariance", "warning"});
  }
  if (scan.head_test.done()) {
    figures.push_back({"Off the epipolar curves", fmt::format("{} px", detail::significant(scan.head_test.off_px, 2)),
                       fmt::format("{}: the test of the calibration by this scan's {}",
                                   detail::expanded(scan.head_test.sigma_px, "px"), scan.head_test.source),
                       ""});
  } else {
    figures.push_back(
        {"Calibration", "not tested", "one direction of fringes, no texture and no markers tell nothing of it", "warning"});
  }
  return figures;
}

std::string pixel_table(const ScanSummary& scan) {
  detail::HtmlTable table(
      "What became of the pixels of each camera, before they were matched.",
      {{"Camera", "", "", false},
       {"With a phase", ""},
       {"Dark", "", "the fringes do not stand out of the noise"},
       {"Saturated", "", "too few samples left that are not cut off"},
       {"Undecided", "", "nothing tells which fringe it is"},
       {"Disturbed", "", "the samples are no shifted cosine: movement, changed light, two surfaces in one pixel"},
       {"Told by neighbours", "", "fringes where the code itself was blurred"}});
  for (const ScannedCamera& camera : scan.cameras) {
    std::vector<detail::Cell> cells = {text_cell(camera.name)};
    for (const PhaseStatus status :
         {PhaseStatus::kValid, PhaseStatus::kDark, PhaseStatus::kSaturated, PhaseStatus::kUndecided, PhaseStatus::kDisturbed}) {
      cells.push_back(number_cell(detail::counted(count(camera, status)), static_cast<double>(count(camera, status))));
    }
    cells.push_back(number_cell(detail::counted(camera.repaired), static_cast<double>(camera.repaired)));
    table.add_row(std::move(cells));
  }
  detail::HtmlTable lost("Why pixels with a phase became no points.", {{"Reason", "", "", false}, {"Pixels", ""}});
  const std::array<std::pair<const char*, std::int64_t>, 6> reasons = {
      {{"beside the end of a surface, where a pixel sees two", scan.guarded},
       {"not seen by the other camera", scan.unmatched},
       {"both phases meet off the epipolar curve", scan.off_curve},
       {"seen at too flat an angle", scan.grazing},
       {"off the surface of its neighbours", scan.off_surface},
       {"on markers", scan.on_markers}}};
  for (const auto& [reason, pixels] : reasons) {
    lost.add_row({text_cell(reason), number_cell(detail::counted(pixels), static_cast<double>(pixels))});
  }
  return table.html() + lost.html();
}

std::string camera_table(const ScanSummary& scan) {
  detail::HtmlTable table(
      "Light and noise. Noise is the camera's own, from the residuals of the fringes unless given: variance = read + shot x "
      "level. "
      "Residuals over sigma are near 1 where light is a cosine and all stood still; the waveform's ripple was taken out.",
      {{"Camera", "", "", false},
       {"Light", "grey levels", "median mean level"},
       {"Modulation", "grey levels", "median"},
       {"Read noise", "grey levels", "root of the variance without light"},
       {"Shot noise", "levels", "growth of the variance with the level"},
       {"Sigma of a phase", "rad", "median"},
       {"Residuals / sigma", ""},
       {"Ripple", "rad"},
       {"Code and fringes agree", "", "1: all places where the code changes are at one phase"}});
  for (const ScannedCamera& camera : scan.cameras) {
    table.add_row({text_cell(camera.name), number_cell(detail::fixed(camera.light, 1), camera.light),
                   number_cell(detail::fixed(camera.modulation, 1), camera.modulation),
                   number_cell(detail::significant(std::sqrt(camera.noise.read)), std::sqrt(camera.noise.read)),
                   number_cell(detail::significant(camera.noise.shot), camera.noise.shot),
                   number_cell(detail::significant(camera.sigma_phase_rad), camera.sigma_phase_rad),
                   number_cell(detail::fixed(camera.residual_ratio, 2), camera.residual_ratio),
                   number_cell(detail::significant(camera.ripple_rad), camera.ripple_rad),
                   number_cell(detail::fixed(camera.word_agreement, 3), camera.word_agreement)});
  }
  return table.html();
}

std::string marker_table(const ScanSummary& scan) {
  detail::HtmlTable table(
      fmt::format(
          "Markers that both cameras read ({} in the left image, {} in the right one). Height is that of a dot over the "
          "wall as the cloud shows it round the marker, to be compared with the thickness of the job, {} mm.",
          scan.markers_read[0], scan.markers_read[1], detail::fixed(scan.marker_thickness_mm, 2)),
      {{"Id", ""},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"Sigma", "mm", "largest axis, of the images' noise"},
       {"Calibration", "mm", "largest axis of its part"},
       {"Off the curve", "px", "of the right image from the left one's epipolar curve"},
       {"Sigma", "px", "of the noise and the calibration"},
       {"Height", "mm"},
       {"Sigma", "mm"}});
  for (const base::ScannedMarker& marker : scan.markers) {
    const double sigma = detail::largest_sigma(marker.cov_mm2);
    const double calibration = detail::largest_sigma(marker.calibration_cov_mm2);
    const double off_sigma = std::hypot(marker.off_curve_sigma_px, marker.off_curve_calibration_px);
    table.add_row(
        {number_cell(std::to_string(marker.id), marker.id),
         number_cell(detail::fixed(marker.p_in_rig_mm.x(), 3), marker.p_in_rig_mm.x()),
         number_cell(detail::fixed(marker.p_in_rig_mm.y(), 3), marker.p_in_rig_mm.y()),
         number_cell(detail::fixed(marker.p_in_rig_mm.z(), 3), marker.p_in_rig_mm.z()),
         number_cell(detail::significant(sigma), sigma), number_cell(detail::significant(calibration), calibration),
         number_cell(detail::fixed(marker.off_curve_px, 3), marker.off_curve_px),
         number_cell(detail::fixed(off_sigma, 3), off_sigma),
         marker.on_wall() ? number_cell(detail::fixed(marker.height_mm, 3), marker.height_mm) : text_cell("-"),
         marker.on_wall() ? number_cell(detail::significant(marker.height_sigma_mm), marker.height_sigma_mm) : text_cell("-")});
  }
  return table.html();
}

std::string stillness_table(const ScanSummary& scan) {
  detail::HtmlTable table("What changed from the first to the last image of the same patterns, and within the sets of fringes.",
                          {{"Camera", "", "", false},
                           {"Shift", "px", "of the whole image, from the first to the last time"},
                           {"Sigma", "px"},
                           {"Looks different", "%", "share of the image"},
                           {"Projector's light", "%"},
                           {"Other light", "%", "of the projector's"},
                           {"Shift within a set", "px", "of one image of fringes against the others, beyond 5 sigmas"}});
  const auto percent = [](const std::optional<double>& share) {
    return share ? number_cell(detail::fixed(100.0 * *share, 2), *share) : text_cell("-");
  };
  for (const ScannedCamera& camera : scan.cameras) {
    const base::Stillness& still = camera.stillness;
    table.add_row(
        {text_cell(camera.name),
         still.shift_told ? number_cell(detail::fixed(still.shift_px, 4), still.shift_px) : text_cell("-"),
         still.shift_told ? number_cell(detail::fixed(still.shift_sigma_px, 4), still.shift_sigma_px) : text_cell("-"),
         percent(still.compared ? std::optional(still.changed_share) : std::nullopt), percent(still.light_change),
         percent(still.ambient_change),
         still.drift_told ? number_cell(detail::fixed(still.drift_px, 3), still.drift_px) : text_cell("-")});
  }
  return table.html();
}

std::string head_table(const ScanSummary& scan) {
  const base::HeadTest& test = scan.head_test;
  detail::HtmlTable table(
      fmt::format(
          "By {} of {} places: what the right camera would have changed by against the left one if that alone explained "
          "the distances from the epipolar curves, and how much of them it explains. The distance between the cameras "
          "changes none of them: it is not tested.",
          test.source, test.samples),
      {{"Change", "", "", false}, {"Value", "mrad"}, {"Sigma", "mrad"}, {"Explains", "%"}});
  for (const base::HeadTest::Term& term : test.terms) {
    table.add_row({text_cell(term.name), number_cell(detail::fixed(1e3 * term.value_rad, 3), term.value_rad),
                   number_cell(detail::significant(1e3 * term.sigma_rad), term.sigma_rad),
                   number_cell(detail::fixed(100.0 * term.explained, 0), term.explained)});
  }
  return detail::paragraph(
             "A calibrated head sees the same on the epipolar curves of both cameras; a head that was knocked or has warmed up "
             "sees "
             "it beside them.") +
         table.html();
}

std::string edge_table(const ScanSummary& scan) {
  detail::HtmlTable table(
      "Edges in the images, by what the phases beside them say. A position is known across its edge; those of one piece of "
      "edge share pixels.",
      {{"Camera", "", "", false},
       {"Material", "", "the surface ends or bends away"},
       {"Shadow", "", "the projector's light ends, nearer material casts the shadow"},
       {"Paint", "", "phases go on: only the brightness steps"},
       {"Sigma across", "px", "median of the material edges"},
       {"Point spread", "px", "sigma, as found at the sharpest steps"},
       {"Piece", "px", "length of edge that tells one position"}});
  for (std::size_t i = 0; i < scan.cameras.size(); ++i) {
    const base::ScannedEdges& edges = scan.edges[i];
    table.add_row({text_cell(scan.cameras[i].name),
                   number_cell(detail::counted(edges.material), static_cast<double>(edges.material)),
                   number_cell(detail::counted(edges.shadow), static_cast<double>(edges.shadow)),
                   number_cell(detail::counted(edges.paint), static_cast<double>(edges.paint)),
                   number_cell(detail::fixed(edges.sigma_px, 3), edges.sigma_px),
                   number_cell(detail::fixed(edges.blur_px, 2), edges.blur_px),
                   number_cell(detail::fixed(edges.piece_px, 0), edges.piece_px)});
  }
  return table.html();
}

/// Lowest value of the cells that hold one.
double lowest(const Eigen::MatrixXd& cells) {
  double value = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < cells.size(); ++i) {
    if (std::isfinite(cells.data()[i])) value = std::min(value, cells.data()[i]);
  }
  return std::isfinite(value) ? value : 0.0;
}

double highest(const Eigen::MatrixXd& cells) {
  double value = -std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < cells.size(); ++i) {
    if (std::isfinite(cells.data()[i])) value = std::max(value, cells.data()[i]);
  }
  return std::isfinite(value) ? value : 1.0;
}

std::string map_of(const ScanSummary& scan, const Eigen::MatrixXd& cells, const std::string& name, double low, double high) {
  const double width = scan.cell_px * static_cast<double>(cells.cols());
  const double height = scan.cell_px * static_cast<double>(cells.rows());
  const detail::HeatGrid grid{detail::make_axis(0.0, width, 6, false), detail::make_axis(0.0, height, 5, false), cells, name,
                              "mm"};
  detail::HeatOptions options;
  options.y_down = true;
  options.low = low;
  options.high = high;
  return detail::heat_map(grid, name, "x [px]", "y [px]", {}, options);
}

}  // namespace

std::string scan_report(const ScanSummary& scan, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(key_figures(scan));
  page.section(
      "maps", "Depth and precision over the left image",
      detail::figures({detail::figure(map_of(scan, scan.depth_mm, "Depth", lowest(scan.depth_mm), highest(scan.depth_mm)),
                                      "Mean depth of each cell, from the left camera."),
                       detail::figure(map_of(scan, scan.sigma_cells_mm, "Sigma", 0.0,
                                             std::min(highest(scan.sigma_cells_mm), 3.0 * scan.sigma_p95_mm)),
                                      "Mean predicted sigma of a point along its viewing ray: the cameras' noise alone.")}));
  if (!scan.sample.empty()) {
    page.scene(
        fmt::format("{} of the points in 3D", detail::counted(static_cast<std::int64_t>(scan.sample.size()))),
        detail::cloud_scene(scan.sample),
        detail::paragraph("The 3D view needs JavaScript and WebGL. The maps above show the same depths and sigmas.", "muted"));
  }
  page.section("pixels", "Pixels", pixel_table(scan));
  if (scan.markers_wanted) page.section("markers", "Markers", marker_table(scan));
  page.section("cameras", "Light, noise and fringes", camera_table(scan));
  page.section("edges", "Edges", edge_table(scan));
  page.section("stillness", "Movement and light", stillness_table(scan));
  if (scan.head_test.done()) page.section("head", "Test of the calibration", head_table(scan));
  if (scan.epipolar_median_px) {
    page.section("calibration", "Distances from the epipolar curves",
                 detail::figure(detail::histogram(scan.epipolar_px, "Distance from the epipolar curve", "px",
                                                  {{std::max(1e-6, scan.epipolar_mad_px), "normal curve of the same scatter"}}),
                                "Signed distances of a sample of the points."));
  }
  if (scan.correlation_length_mm > 0.0) {
    page.section("filter", "Filter",
                 detail::paragraph(
                     fmt::format("Depths are averages: points within {} mm of each other are correlated, and no detail finer "
                                 "than that is kept.",
                                 detail::fixed(scan.correlation_length_mm, 2))));
  }
  return page.html();
}

}  // namespace crosstie::report
