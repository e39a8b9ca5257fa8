#include <cmath>

#include <fmt/format.h>

#include "report/detail/calibration_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::Calibration;

std::string folds_table(const Calibration& calibration) {
  std::vector<Column> columns = {{"Views held out", "", "all but these took part", false}, {"Moments", "", "that took part"}};
  for (const auto& camera : calibration.cameras) columns.push_back({fmt::format("Rms {}", camera.name), "px", "per point"});
  if (calibration.rig) columns.insert(columns.end(), {{"Baseline", "mm"}, {"Sigma", "mm"}});
  HtmlTable table("Solves with part of the views; of the others only the board's pose was fitted.", columns);
  const auto add = [&](const base::HeldOutFold& fold) {
    std::vector<Cell> row = {text_cell(fold.name), number_cell(std::to_string(fold.stations), fold.stations)};
    for (std::size_t c = 0; c < calibration.cameras.size(); ++c) {
      const double rms = c < fold.rms_px.size() ? fold.rms_px[c] : std::nan("");
      row.push_back(number_cell(significant(rms, 3), rms));
    }
    if (calibration.rig) {
      row.push_back(number_cell(fixed(fold.baseline_mm, 3), fold.baseline_mm));
      row.push_back(number_cell(fixed(fold.baseline_sigma_mm, 3), fold.baseline_sigma_mm));
    }
    table.add_row(std::move(row));
  };
  for (const auto& half : calibration.validation->halves) add(half);
  for (const auto& fold : calibration.validation->folds) add(fold);
  return table.html();
}

std::string halves_table(const Calibration& calibration) {
  const base::CrossValidation& validation = *calibration.validation;
  if (validation.halves.size() != 2) return "";
  HtmlTable table(
      "Odd against even views: what two independent halves differ by, against what their sigmas predict. Far above twice the "
      "prediction something is not in the model, and every sigma of this report is too small.",
      {{"Quantity", "", "", false}, {"Difference", ""}, {"Predicted", ""}, {"Unit", "", "", false}, {"Ratio", ""}});
  constexpr double kDoubtful = 2.0;
  const auto row = [&](const std::string& name, double value, double predicted, const char* unit) {
    const double ratio = predicted > 0.0 ? std::abs(value) / predicted : std::nan("");
    table.add_row({text_cell(name), number_cell(significant(value, 2), value),
                   number_cell(significant(predicted, 2), predicted), text_cell(unit),
                   number_cell(fixed(ratio, 2), ratio, ratio > kDoubtful ? "warning" : "")});
  };
  for (std::size_t c = 0; c < calibration.cameras.size() && c < validation.model_difference_px.size(); ++c) {
    row(fmt::format("projection, camera {}", calibration.cameras[c].name), validation.model_difference_px[c],
        validation.model_difference_predicted_px[c], "px");
  }
  if (calibration.rig) row("baseline", validation.baseline_gap_mm, validation.baseline_gap_sigma_mm, "mm");
  return table.html();
}

std::string lens_table(const Calibration& calibration) {
  HtmlTable table(
      "Lens models. The simplest is chosen whose held-out views are predicted as well as by the best (one standard error); the "
      "rms of corners that took part always falls with more parameters and decides nothing.",
      {{"Model", "", "", false}, {"Rms", "px"}, {"Held-out rms", "px"}, {"Worse by", "sigmas"}, {"Finding", "", "", false}});
  for (const base::LensTrial& trial : calibration.ladder) {
    const std::string name(base::lens_model_name(trial.lens));
    if (!trial.failure.empty()) {
      table.add_row({text_cell(name), text_cell(""), text_cell(""), text_cell(""), text_cell(trial.failure, "prose")});
      continue;
    }
    table.add_row({text_cell(name), number_cell(fixed(trial.rms_px, 4), trial.rms_px),
                   number_cell(fixed(trial.rms_heldout_px, 4), trial.rms_heldout_px),
                   number_cell(fixed(trial.worse_by_sigmas, 2), trial.worse_by_sigmas),
                   text_cell(trial.chosen ? "chosen" : "", trial.chosen ? "ok" : "")});
  }
  return "<h3>Lens models</h3>\n" + table.html();
}

std::string detector_table(const Calibration& calibration) {
  HtmlTable table("Corner detectors on the same images. What they differ by is part of no sigma.",
                  {{"Detector", "", "", false},
                   {"Images", "", "with the board"},
                   {"Corners", ""},
                   {"Apart", "px", "rms distance from the corners that were used"},
                   {"Rms", "px"},
                   {"fx", "px", "of the first camera"},
                   {"Baseline", "mm"},
                   {"Finding", "", "", false}});
  for (const base::DetectorTrial& trial : calibration.detectors) {
    const bool solved = trial.failure.empty() && !trial.focal_px.empty();
    const auto number = [&](double value, int decimals) {
      return solved ? number_cell(fixed(value, decimals), value) : text_cell("\u2013");
    };
    table.add_row({text_cell(trial.detector), number_cell(std::to_string(trial.images), trial.images),
                   number_cell(std::to_string(trial.corners), trial.corners), number(trial.difference_px, 3),
                   number(trial.rms_px, 3), number(solved ? trial.focal_px.front() : 0.0, 2), number(trial.baseline_mm, 3),
                   text_cell(trial.used ? "used" : trial.failure, trial.used ? "ok" : "prose")});
  }
  return "<h3>Detectors</h3>\n" + table.html();
}

std::string opinion_table(const Calibration& calibration) {
  const base::SecondOpinion& opinion = *calibration.second_opinion;
  if (!opinion.failure.empty()) return "<h3>Another program</h3>\n" + paragraph(opinion.program + ": " + opinion.failure);
  HtmlTable table(
      fmt::format("{} with {} and a {} board on the same corners; our own solver under the same assumptions; and the "
                  "calibration of this report.",
                  opinion.program, base::lens_model_name(opinion.lens), opinion.board),
      {{"Solve", "", "", false}, {"Rms", "px"}, {"fx", "px", "of the first camera"}, {"Baseline", "mm"}});
  const auto row = [&](const std::string& name, double rms, double focal, double baseline) {
    table.add_row({text_cell(name), number_cell(fixed(rms, 4), rms), number_cell(fixed(focal, 4), focal),
                   number_cell(fixed(baseline, 4), baseline)});
  };
  row(opinion.program, opinion.rms_px, opinion.parameters.empty() ? std::nan("") : opinion.parameters.front()(0),
      opinion.baseline_mm);
  if (!opinion.our_focal_px.empty())
    row("ours, same assumptions", opinion.our_rms_px, opinion.our_focal_px.front(), opinion.our_baseline_mm);
  row("this calibration", calibration.rms_px, calibration.cameras.front().camera.focal_px().x(),
      calibration.rig ? calibration.rig->baseline_mm : std::nan(""));
  return "<h3>Another program</h3>\n" + table.html();
}

}  // namespace

std::string calibration_validation_section(const Calibration& calibration) {
  if (!calibration.validation) {
    return paragraph(
        "Not validated: nothing tells how well this calibration predicts what it has not seen. Its sigmas are those "
        "of the model, and the model may be wrong.");
  }
  return halves_table(calibration) + folds_table(calibration);
}

std::string calibration_trials_section(const Calibration& calibration) {
  std::string html;
  if (!calibration.ladder.empty()) html += lens_table(calibration);
  if (!calibration.detectors.empty()) html += detector_table(calibration);
  if (calibration.second_opinion) html += opinion_table(calibration);
  return html.empty() ? paragraph("No other lens model, detector or program was tried.") : html;
}

}  // namespace crosstie::report::detail
