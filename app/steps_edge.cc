// edge pixels and depths of a scan -> the hole's edge

#include "app/steps_edge.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/nominal_input.h"
#include "app/result_folder.h"
#include "app/scan_folder.h"
#include "base/result_document.h"
#include "base/table.h"
#include "base/text.h"
#include "edge/nominal_fit.h"
#include "report/edge_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
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

ordered_json nominal_json(const edge::NominalFit& fit) {
  ordered_json sigmas = ordered_json::array();
  ordered_json sizes = ordered_json::object();
  const auto names = edge::size_names(fit.nominal.kind);
  for (std::size_t i = 0; i < fit.nominal.size_mm.size(); ++i) {
    sizes[names[i] + "_mm"] = fit.nominal.size_mm[i];
    sigmas.push_back(fit.size_sigma_mm(i));
  }
  const Eigen::Vector3d& at = fit.frame_from_hole.translation_mm;
  const Eigen::Vector3d normal = fit.frame_from_hole.rotation * Eigen::Vector3d::UnitZ();
  return {{"type", edge::name_of(fit.nominal.kind)},
          {"params", sizes},
          {"sigmas", sigmas},
          {"centre_mm", {at.x(), at.y(), at.z()}},
          {"normal", {normal.x(), normal.y(), normal.z()}},
          {"rms_u_mm", fit.rms_u_mm},
          {"rms_v_mm", fit.rms_v_mm},
          {"sigma0", fit.sigma0},
          {"redundancy", fit.redundancy}};
}

ordered_json edge_json(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit) {
  ordered_json gaps = ordered_json::array();
  for (const base::EdgeGap& gap : hole.curve.gaps)
    gaps.push_back({{"from_mm", gap.from_mm}, {"length_mm", gap.length_mm}, {"reason", gap.reason}});
  const auto& counts = hole.counts;
  return {{"length_mm", hole.curve.length_mm},
          {"closed", hole.curve.closed},
          {"points", hole.curve.points.size()},
          {"gaps", gaps},
          {"nominal", fit ? nominal_json(*fit) : ordered_json()},
          {"rms_mm", fit ? ordered_json(fit->rms_mm) : ordered_json()},
          {"roughness_factor", hole.roughness_factor},
          {"edge_pixels",
           {{"used", counts.used},
            {"shadow", counts.shadow},
            {"no_surface", counts.no_surface},
            {"off_face", counts.off_face},
            {"inwards", counts.inwards},
            {"masked", counts.masked},
            {"stray", counts.stray},
            {"inner", counts.inner}}}};
}

Result<> write_curve(const fs::path& path, const edge::HoleEdge& hole) {
  base::Table table;
  table.path = path;
  table.columns = {"s_mm", "x_mm", "y_mm", "z_mm", "sigma_u_mm", "sigma_v_mm", "nx", "ny", "nz", "tx", "ty", "tz", "source"};
  for (std::size_t i = 0; i < hole.curve.points.size(); ++i) {
    const base::EdgePoint& point = hole.curve.points[i];
    std::vector<std::string> row;
    for (const double value :
         {point.s_mm, point.point_mm.x(), point.point_mm.y(), point.point_mm.z(), point.sigma_u_mm, point.sigma_v_mm,
          point.normal.x(), point.normal.y(), point.normal.z(), point.tangent.x(), point.tangent.y(), point.tangent.z()}) {
      row.push_back(base::format_double(value));
    }
    const auto& pixels = hole.points[i].pixels;
    row.emplace_back(pixels[0] > 0 && pixels[1] > 0 ? "both" : pixels[0] > 0 ? "left" : "right");
    table.rows.push_back(std::move(row));
  }
  return base::write_table(path, table);
}

report::EdgeView view_of(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit, const ScanFolder& scan) {
  report::EdgeView view;
  view.curve = hole.curve;
  view.roughness_factor = hole.roughness_factor;
  if (fit) {
    view.rms_u_mm = fit->rms_u_mm;
    view.rms_v_mm = fit->rms_v_mm;
    view.nominal = std::string(edge::name_of(fit->nominal.kind));
    const auto names = edge::size_names(fit->nominal.kind);
    for (std::size_t i = 0; i < fit->nominal.size_mm.size(); ++i)
      view.nominal += fmt::format(", {} {:.3f} mm, sigma {:.3f} mm", names[i], fit->nominal.size_mm[i], fit->size_sigma_mm(i));
    if (fit->deviations.points.size() == hole.curve.points.size()) {
      for (Eigen::Index i = 0; i < fit->deviations.uv_mm.cols(); ++i) {
        view.off_u_mm.push_back(fit->deviations.uv_mm(0, i));
        view.off_v_mm.push_back(fit->deviations.uv_mm(1, i));
      }
    }
  }
  for (std::size_t camera = 0; camera < 2; ++camera) {
    for (const edge::RimPoint& point : hole.points) {
      view.camera_off_mm[camera].push_back(point.pixels[camera] > 0 ? point.off_mm[camera]
                                                                    : std::numeric_limits<double>::quiet_NaN());
    }
    for (const base::EdgePoint& point : hole.curve.points) {
      const auto at = camera == 0 ? scan.head.left.project(point.point_mm)
                                  : scan.head.right.project(scan.head.right_from_left * point.point_mm);
      if (at) view.curve_px[camera].push_back(*at);
    }
    view.edges[camera] = scan.edges[camera];
  }
  const auto& counts = hole.counts;
  view.fates = {{"used", counts.used},
                {"a shadow's, not a material edge", counts.shadow},
                {"without depths on the material side", counts.no_surface},
                {"on another surface than the face: ledge, far rim, cut face", counts.off_face},
                {"with the hole on the wrong side: outer contours", counts.inwards},
                {"on a marker or magnet", counts.masked},
                {"contradicting neighbours or the other camera", counts.stray},
                {"far side of a chamfer", counts.inner}};
  return view;
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
  auto hole = edge::find_hole_edge(std::span(&station, 1), task.options, session.progress());
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
  base::ResultEnvelope envelope{"edge", "rig", *inputs, {}, warnings};
  const ordered_json result = base::result_json(envelope, options, edge_json(*hole, fit));
  if (auto done = write_curve(folder->path() / "edge.csv", *hole); !done) return base::fail(std::move(done));
  const std::string html =
      report::edge_report(view_of(*hole, fit, *scan), {"Hole edge", task.title, envelope, options.dump(2)});
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  std::string said = fmt::format("{} points over {:.1f} mm, {}, {} gaps", hole->curve.points.size(), hole->curve.length_mm,
                                 hole->curve.closed ? "closed" : "open", hole->curve.gaps.size());
  if (fit) {
    said += fmt::format("; {}", edge::name_of(fit->nominal.kind));
    for (std::size_t i = 0; i < fit->nominal.size_mm.size(); ++i)
      said += fmt::format(" {:.3f} mm (sigma {:.3f})", fit->nominal.size_mm[i], fit->size_sigma_mm(i));
    said += fmt::format(", rms {:.3f} mm", fit->rms_mm);
  }
  return StepOutcome{out, said, false, outcome_of(result)};
}

}  // namespace crosstie::app
