// edge pixels and depths of a scan -> the hole's edge

#include "app/steps_edge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/edge_result.h"
#include "app/nominal_input.h"
#include "app/result_folder.h"
#include "app/scan_folder.h"
#include "base/result_document.h"
#include "edge/nominal_fit.h"
#include "report/edge_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::ordered_json;

ordered_json effective_options(const EdgeTask& task) {
  ordered_json options = {{"nominal", task.nominal},
                          {"head", task.head},
                          {"cell_mm", task.options.cell_mm},
                          {"surface_reach_px", task.options.surface_reach_px},
                          {"surface_guard_px", task.options.surface_guard_px},
                          {"max_off_face_mm", task.options.max_off_face_mm},
                          {"max_turn_rad", task.options.max_turn_rad},
                          {"max_w", task.options.max_w},
                          {"min_gap_cells", task.options.min_gap_cells}};
  if (task.options.roi_px) options["roi_px"] = *task.options.roi_px;
  if (task.options.arc_rad) options["arc_rad"] = *task.options.arc_rad;
  return options;
}

Result<std::vector<base::ResultInput>> inputs_of(const EdgeTask& task, const edge::Nominal& nominal,
                                                 std::vector<fs::path> files) {
  if (nominal.kind == edge::NominalKind::kPoints) files.emplace_back(task.nominal);
  return hashed_inputs(files, task.base_folder);
}

/// Where a stretch of the rim lies, from and to as --arc has them [deg].
std::optional<std::array<double, 2>> arc_of(const edge::ForeignStretch& stretch, const edge::HoleEdge& hole,
                                            const base::Camera& left, const std::array<double, 4>& roi_px) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const Eigen::Vector2d middle(0.5 * (roi_px[0] + roi_px[2]), 0.5 * (roi_px[1] + roi_px[3]));
  std::vector<double> angles;
  for (const std::size_t i : {stretch.points[0], stretch.points[1], stretch.points.back()}) {
    const auto at = left.project(hole.curve.points[i].point_mm);
    if (!at) return std::nullopt;
    const double angle = std::atan2(at->y() - middle.y(), at->x() - middle.x()) / kDegree;
    angles.push_back(angle < 0.0 ? angle + 360.0 : angle);
  }
  const bool grows = std::remainder(angles[1] - angles[0], 360.0) > 0.0;
  return grows ? std::array{angles[0], angles[2]} : std::array{angles[2], angles[0]};
}

/// The arcs of the stretches that were left out, in the result and in their warnings.
void add_arcs(const edge::HoleEdge& hole, const edge::NominalFit& fit, const base::Camera& left,
              const std::array<double, 4>& roi_px, std::vector<base::Warning>& warnings, ordered_json& body) {
  auto warning = warnings.begin();
  for (std::size_t i = 0; i < fit.left_out.size(); ++i) {
    const auto arc = arc_of(fit.left_out[i], hole, left, roi_px);
    warning = std::find_if(warning, warnings.end(), [](const auto& one) { return one.code == "stretch_left_out"; });
    if (!arc || warning == warnings.end()) return;
    body["nominal"]["left_out"][i]["arc_deg"] = {(*arc)[0], (*arc)[1]};
    warning->message += fmt::format("; as an arc {:.0f},{:.0f}", (*arc)[0], (*arc)[1]);
    ++warning;
  }
}

}  // namespace

Result<StepOutcome> edge_step(const EdgeTask& task, const fs::path& out, Session& session) {
  auto nominal = nominal_of(task.nominal, {});
  if (!nominal) return base::fail(std::move(nominal));
  auto scan = read_scan_folder(task.scan, task.head);
  if (!scan) return base::fail(std::move(scan));
  const ordered_json options = effective_options(task);
  const auto inputs = inputs_of(task, *nominal, scan->files);
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs))
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));

  edge::StationView station;
  station.name = task.scan.filename().string();
  station.head = &scan->head;
  station.edges = {&scan->edges[0], &scan->edges[1]};
  station.depth_mm = &scan->depth_mm;
  station.sigma_mm = &scan->sigma_mm;
  station.off_curve = scan->off_curve;
  auto hole = edge::find_hole_edge(std::span(&station, 1), task.options, {}, session.progress());
  if (!hole) return base::fail(std::move(hole));
  hole->curve.frame = "rig";
  std::optional<edge::NominalFit> fit;
  std::vector<base::Warning> warnings = hole->warnings;
  if (auto fitted = edge::fit_nominal(hole->curve, *nominal); fitted) {
    fit = *std::move(fitted);
    warnings.insert(warnings.end(), fit->warnings.begin(), fit->warnings.end());
  } else {
    warnings.push_back({"nominal_not_fitted", task.nominal, fitted.error().message});
  }
  ordered_json body = edge_json(*hole, fit);
  if (fit && task.options.roi_px) add_arcs(*hole, *fit, station.head->left, *task.options.roi_px, warnings, body);
  base::ResultEnvelope envelope{"edge", "rig", *inputs, {}, warnings};
  const ordered_json result = base::result_json(envelope, options, body);
  if (auto done = write_edge(folder->path() / "edge.csv", *hole); !done) return base::fail(std::move(done));
  report::EdgeView view = edge_view(*hole, fit);
  add_edge_images(station, hole->curve, view);
  const std::string html =
      report::edge_report(view, {"Hole edge", task.title, envelope, options.dump(2), overview_of(out, session)});
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out, edge_summary(*hole, fit), false, outcome_of(result)};
}

}  // namespace crosstie::app
