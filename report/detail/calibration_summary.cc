#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/calibration_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {

using base::Calibration;

std::vector<KeyFigure> calibration_key_figures(const Calibration& calibration) {
  std::vector<KeyFigure> figures;
  if (calibration.rig) {
    figures.push_back({"Baseline", with_sigma(calibration.rig->baseline_mm, calibration.rig->baseline_sigma_mm, "mm"),
                       expanded(calibration.rig->baseline_sigma_mm, "mm") + " (k = 2)", ""});
  }
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    const Eigen::MatrixXd& cov = camera.camera.covariance();
    const double sigma = cov.size() > 0 ? std::sqrt(std::max(0.0, cov(0, 0))) : 0.0;
    figures.push_back({fmt::format("Focal length fx, {}", camera.name), with_sigma(camera.camera.focal_px().x(), sigma, "px"),
                       expanded(sigma, "px") + " (k = 2)", ""});
  }
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    const bool validated = camera.rms_heldout_px > 0.0;
    figures.push_back(
        {fmt::format("{}, {}", validated ? "Held-out rms per point" : "Rms per point", camera.name),
         fmt::format("{} px", significant(validated ? camera.rms_heldout_px : camera.rms_px)),
         validated ? fmt::format("{} px of corners that took part", significant(camera.rms_px)) : std::string("not validated"),
         ""});
  }
  figures.push_back({"Sigma of a corner's coordinate", fmt::format("{} px", significant(calibration.sigma0_px)),
                     "as the residuals tell it", ""});
  figures.push_back({"Redundancy", counted(calibration.redundancy),
                     fmt::format("n {} \u2212 u {}", counted(calibration.observations), counted(calibration.unknowns)), ""});
  const auto corners =
      std::count_if(calibration.rejected.begin(), calibration.rejected.end(), [](const auto& one) { return one.corner >= 0; });
  const double all = static_cast<double>(corners) + static_cast<double>(calibration.residuals.size());
  const double share = all > 0.0 ? static_cast<double>(corners) / all : 0.0;
  constexpr double kManyRejected = 0.03;
  figures.push_back(
      {"Rejected corners", counted(corners),
       fmt::format("{} % of {}; beyond 3 % is suspicious", fixed(100.0 * share, 2), counted(static_cast<long long>(all))),
       share > kManyRejected ? "warning" : ""});
  return figures;
}

std::string calibration_cameras_section(const Calibration& calibration) {
  base::AdjustedNetwork network;  // its tables show lenses as these do
  network.redundancy = calibration.redundancy;
  for (const base::CalibratedCamera& one : calibration.cameras) {
    base::AdjustedCamera& camera =
        network.cameras.emplace_back(base::AdjustedCamera{one.name, one.camera, true, one.area.inner_share(), {}});
    camera.significance_p = one.significance_p;
  }
  std::string html = bundle_cameras_section(network);
  for (const base::CalibratedCamera& one : calibration.cameras) {
    if (!one.temperature_c) continue;
    html +=
        paragraph(fmt::format("Camera {} had {} \u00b0C while it took the images. Lenses and mounts drift as they warm up: "
                              "measure at the temperature of the calibration.",
                              one.name, plain(*one.temperature_c)));
  }
  return html;
}

std::string calibration_rig_section(const base::CalibratedRig& rig) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  const Eigen::Vector3d turn = base::rotation_log(rig.right_from_left.rotation);
  const Eigen::Vector3d centre = rig.right_from_left.inverse().translation_mm;
  const Eigen::Vector3d centre_sigma =
      base::position_covariance(rig.right_from_left, rig.cov).diagonal().cwiseMax(0.0).cwiseSqrt();
  HtmlTable table(fmt::format("{} against {}: rotation vector of right_from_left, and the projection centre of {} in the rig's "
                              "frame ({}).",
                              rig.right, rig.left, rig.right, rig.left),
                  {{"Component", "", "", false}, {"Value", ""}, {"Sigma", ""}, {"U", "", "k = 2"}, {"Unit", "", "", false}});
  const auto row = [&table](const char* name, double value, double sigma, const char* unit) {
    const int decimals = decimals_for_sigma(sigma, 6);
    table.add_row({text_cell(name), number_cell(fixed(value, decimals), value), number_cell(fixed(sigma, decimals), sigma),
                   number_cell(fixed(2.0 * sigma, decimals), 2.0 * sigma), text_cell(unit)});
  };
  constexpr std::array kTurns = {"rotation about x", "rotation about y", "rotation about z"};
  constexpr std::array kPlaces = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    row(kTurns.at(static_cast<std::size_t>(i)), kDegrees * turn(i), kDegrees * std::sqrt(std::max(0.0, rig.cov(i, i))),
        "\u00b0");
  }
  for (int i = 0; i < 3; ++i) row(kPlaces.at(static_cast<std::size_t>(i)), centre(i), centre_sigma(i), "mm");
  row("baseline", rig.baseline_mm, rig.baseline_sigma_mm, "mm");
  return table.html() + paragraph(fmt::format("From {} moments that both cameras saw. The baseline carries the scale of the "
                                              "board: its sigma holds the prior of the pitch.",
                                              rig.stations));
}

std::string calibration_views_section(const Calibration& calibration) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  HtmlTable table("Images that took part.", {{"Image", "", "", false},
                                             {"Camera", "", "", false},
                                             {"Moment", "", "", false},
                                             {"Corners", ""},
                                             {"Rejected", ""},
                                             {"Rms", "px", "per point"},
                                             {"Max", "px"},
                                             {"Distance", "mm", "of the board's middle"},
                                             {"Tilt", "\u00b0", "of the board against the line of sight"}});
  constexpr double kBad = 3.0;
  std::vector<double> all;
  for (const auto& view : calibration.views) all.push_back(view.rms_px);
  const double middle = median(all);
  for (const base::CalibratedView& view : calibration.views) {
    table.add_row({text_cell(view.image), text_cell(view.camera),
                   text_cell(calibration.stations.at(static_cast<std::size_t>(view.station)).name),
                   number_cell(std::to_string(view.corners), view.corners),
                   number_cell(std::to_string(view.rejected), view.rejected),
                   number_cell(fixed(view.rms_px, 4), view.rms_px, view.rms_px > kBad * middle ? "warning" : ""),
                   number_cell(fixed(view.max_px, 4), view.max_px), number_cell(fixed(view.distance_mm, 0), view.distance_mm),
                   number_cell(fixed(kDegrees * view.tilt_rad, 0), view.tilt_rad)});
  }
  return table.html();
}

std::string calibration_rejected_section(const Calibration& calibration) {
  if (calibration.rejected.empty()) return paragraph("No corner and no image was rejected.");
  HtmlTable table("Corners and images that took no part, with the reason.",
                  {{"Image", "", "", false}, {"Corner", ""}, {"Reason", "", "", false}, {"w", "", "standardised residual"}});
  table.limit_rows(1000, "corners.csv");
  for (const base::RejectedCorner& one : calibration.rejected) {
    table.add_row(
        {text_cell(one.image), one.corner >= 0 ? number_cell(std::to_string(one.corner), one.corner) : text_cell("the image"),
         text_cell(one.reason, "prose"), one.w != 0.0 ? number_cell(significant(one.w), one.w) : text_cell("\u2013")});
  }
  return table.html();
}

}  // namespace crosstie::report::detail
