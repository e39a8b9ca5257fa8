// edge pixels and depths of all stations, their places, the nominal hole -> the hole's edge, the part's place, the torch's path

#include "app/job_edge.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/edge_result.h"
#include "app/job_scan.h"
#include "app/measured_part.h"
#include "app/nominal_input.h"
#include "app/path_files.h"
#include "app/result_folder.h"
#include "app/scan_folder.h"
#include "base/result_document.h"
#include "base/stitching_reader.h"
#include "edge/tool_path.h"
#include "math/head_point.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;
using nlohmann::ordered_json;

constexpr double kMarkerRadii = 3.6;  // of a ring marker's sheet, in radii of its dot

/// The nominal hole with the place that is known of it.
struct PlacedNominal {
  edge::NominalCurve curve;
  base::Pose frame_from_hole;
  base::Matrix6d cov = base::Matrix6d::Zero();
};

ordered_json triple(const std::optional<Eigen::Vector3d>& v) {
  return v ? ordered_json::array({v->x(), v->y(), v->z()}) : ordered_json(nullptr);
}

template <typename T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json effective_options(const Job& job) {
  const JobHole& hole = *job.hole;
  const JobPart& part = job.part;
  const JobPath& path = job.path;
  return {{"hole",
           {{"nominal", hole.nominal},
            {"nominal_frame", hole.nominal_frame},
            {"nominal_unit", hole.unit},
            {"closed", hole.closed},
            {"spline", hole.spline},
            {"diameter_mm", or_null(hole.diameter_mm)},
            {"length_mm", or_null(hole.length_mm)},
            {"width_mm", or_null(hole.width_mm)},
            {"exponent", hole.exponent},
            {"centre_mm", triple(hole.centre_mm)},
            {"normal", triple(hole.normal)},
            {"length_direction", triple(hole.direction)}}},
          {"part",
           {{"position", part.position},
            {"axis_point_mm", triple(part.axis_point_mm)},
            {"axis_direction", triple(part.axis_direction)},
            {"axis_in_machine", triple(part.axis_in_machine)},
            {"radius_mm", or_null(part.radius_mm)},
            {"half_angle_rad", part.half_angle_rad},
            {"head", part.seen_from_inside ? "inside" : "outside"}}},
          {"path",
           {{"step_mm", path.step_mm},
            {"cutoff_mm", path.cutoff_mm},
            {"tilt_cutoff_mm", path.tilt_cutoff_mm},
            {"max_correction_mm", path.max_correction_mm},
            {"max_slope", path.max_slope},
            {"max_gap_mm", path.max_gap_mm},
            {"blend_mm", path.blend_mm},
            {"direction", path.counter_clockwise ? "ccw" : "cw"},
            {"start_mm", path.start_mm},
            {"bevel_rad", path.bevel_rad},
            {"lead_rad", path.lead_rad},
            {"standoff_mm", path.standoff_mm},
            {"offset_mm", path.offset_mm},
            {"speed_mm_per_s", path.speed_mm_per_s},
            {"max_turn_rad_per_s", or_null(path.max_turn_rad_per_s)},
            {"reach_low_mm", triple(path.reach_low_mm)},
            {"reach_high_mm", triple(path.reach_high_mm)},
            {"retract_mm", path.retract_mm},
            {"arc_tolerance_mm", path.arc_tolerance_mm}}},
          {"dot_diameter_mm", or_null(job.dot_diameter_mm)}};
}

/// The stations of a stitching as the search for the edge takes them.
struct Views {
  std::deque<ScanFolder> scans;  // does not move what it holds: the views point into it
  std::vector<edge::StationView> stations;
  edge::SharedKnowledge shared;
};

Result<Views> read_views(const JobEdgeTask& task, const base::Stitching& stitching, Session& session) {
  Views views;
  const base::Progress progress = session.progress();
  for (const base::StitchedStation& station : stitching.stations) {
    if (progress.cancelled()) return base::cancelled("edge");
    progress("reading scans", views.scans.size(), stitching.stations.size());
    auto scan = read_scan_folder(task.scans / station.name, task.head);
    if (!scan) return fail(scan.error().code, fmt::format("station {}: {}", station.name, scan.error().message));
    const ScanFolder& kept = views.scans.emplace_back(*std::move(scan));
    views.stations.push_back({.name = station.name,
                              .head = &views.scans.front().head,
                              .edges = {&kept.edges[0], &kept.edges[1]},
                              .depth_mm = &kept.depth_mm,
                              .sigma_mm = &kept.sigma_mm,
                              .frame_from_rig = station.machine_from_rig,
                              .frame_from_rig_cov = station.cov});
  }
  const base::Head& head = views.scans.front().head;
  const Eigen::Index poses = 6 * static_cast<Eigen::Index>(stitching.stations.size());
  // Of a head without a covariance nothing is known that the points could share.
  views.shared.cov = Eigen::MatrixXd::Zero(poses + head.parameter_count(), poses + head.parameter_count());
  const Eigen::Index known = std::min(stitching.covariance.rows(), views.shared.cov.rows());
  views.shared.cov.topLeftCorner(known, known) = stitching.covariance.topLeftCorner(known, known);
  if (stitching.head) views.shared.head_change = math::head_change(head, *stitching.head);
  return views;
}

/// Where the nominal lies in the curve's frame; nothing where only the edge itself can tell.
std::optional<PlacedNominal> placed(const NominalInput& input, const edge::NominalCurve& curve, const edge::Workpiece& part,
                                    const std::string& frame) {
  if (!input.frame_from_hole) return std::nullopt;
  if (frame == input.frame) return PlacedNominal{curve, *input.frame_from_hole};
  if (frame == "machine") return PlacedNominal{curve, part.machine_from_part * *input.frame_from_hole, part.covariance};
  return std::nullopt;
}

std::vector<edge::MaskedDisc> masks_of(const Job& job, const base::Stitching& stitching) {
  std::vector<edge::MaskedDisc> masks;
  if (!job.dot_diameter_mm) return masks;
  for (const base::StitchedMarker& marker : stitching.markers) {
    masks.push_back({fmt::format("marker {}", marker.id), marker.xyz_mm, 0.5 * kMarkerRadii * *job.dot_diameter_mm});
  }
  return masks;
}

/// The middle of the nominal in its own frame.
Eigen::Vector3d middle_of(const NominalInput& input) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : input.nominal.points_mm) middle += p / static_cast<double>(input.nominal.points_mm.size());
  return middle;
}

std::vector<double> numbers(const base::Pose& pose) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = pose.matrix();
  return {matrix.data(), matrix.data() + matrix.size()};
}

ordered_json part_json(const edge::Workpiece& part) {
  ordered_json cov = ordered_json::array();
  for (Eigen::Index row = 0; row < 6; ++row) {
    for (Eigen::Index column = row; column < 6; ++column) cov.push_back(part.covariance(row, column));
  }
  ordered_json residuals = ordered_json::array();
  for (const edge::PartResidual& one : part.residuals)
    residuals.push_back({{"id", one.id}, {"residual_mm", triple(one.residual_mm)}, {"sigma_mm", triple(one.sigma_mm)}});
  return {{"machine_from_part", numbers(part.machine_from_part)},
          {"machine_from_part_cov", cov},
          {"part",
           {{"source", part.source},
            {"sigma0", part.redundancy > 0 ? ordered_json(part.sigma0) : ordered_json(nullptr)},
            {"redundancy", part.redundancy},
            {"radius_error_mm", part.source == "tower" ? ordered_json(part.radius_error_mm) : ordered_json(nullptr)},
            {"radius_sigma_mm", part.source == "tower" ? ordered_json(part.radius_sigma_mm) : ordered_json(nullptr)},
            {"residuals", residuals}}}};
}

ordered_json path_json(const base::ToolPath& path) {
  double most = 0.0;
  for (const base::ToolPathPoint& p : path.points) most = std::max(most, std::abs(p.correction_u_mm));
  ordered_json gaps = ordered_json::array();
  for (const base::EdgeGap& gap : path.gaps)
    gaps.push_back({{"from_mm", gap.from_mm}, {"length_mm", gap.length_mm}, {"reason", gap.reason}});
  return {{"frame", path.frame},         {"closed", path.closed},         {"points", path.points.size()},
          {"length_mm", path.length_mm}, {"duration_s", path.duration_s}, {"max_correction_u_mm", most},
          {"gaps", std::move(gaps)}};
}

/// Root mean square and largest of the deviations from the nominal where it lies.
ordered_json off_json(const edge::EdgeDeviations& off) {
  if (off.points.empty()) return nullptr;
  const auto count = static_cast<double>(off.points.size());
  return {{"rms_u_mm", std::sqrt(off.uv_mm.row(0).squaredNorm() / count)},
          {"rms_v_mm", std::sqrt(off.uv_mm.row(1).squaredNorm() / count)},
          {"max_u_mm", off.uv_mm.row(0).cwiseAbs().maxCoeff()},
          {"max_v_mm", off.uv_mm.row(1).cwiseAbs().maxCoeff()}};
}

std::vector<base::Verdict> verdicts_of(const JobPath& limits, const edge::HoleEdge& hole, const base::ToolPath& path) {
  double gap = 0.0;
  for (const base::EdgeGap& one : hole.curve.gaps) gap = std::max(gap, one.length_mm);
  double correction = 0.0, sigma = 0.0;
  for (const base::ToolPathPoint& p : path.points) {
    if (std::abs(p.correction_u_mm) <= correction) continue;
    correction = std::abs(p.correction_u_mm);
    sigma = p.sigma_u_mm;
  }
  return {{"largest gap of the rim", gap, limits.max_gap_mm, "mm", "path.max_gap_mm of the job",
           base::judge_upper_limit(gap, limits.max_gap_mm, 0.0)},
          {"largest correction of the path", correction, limits.max_correction_mm, "mm", "path.max_correction_mm of the job",
           base::judge_upper_limit(correction, limits.max_correction_mm, 2.0 * sigma)}};
}

void append(const std::vector<base::Warning>& more, std::vector<base::Warning>& warnings) {
  warnings.insert(warnings.end(), more.begin(), more.end());
}

/// All that is found, before it is written.
struct Found {
  edge::HoleEdge hole;
  std::optional<edge::NominalFit> fit;
  edge::Workpiece part;
  edge::EdgeDeviations off;  ///< from the nominal where it lies
  base::ToolPath path;
  std::vector<base::Warning> warnings;
};

Result<Found> find(const JobEdgeTask& task, const NominalInput& input, const base::Stitching& stitching, const Views& views,
                   Session& session) {
  Found found;
  const Job& job = task.job;
  const fs::path cloud = task.stitch / "cloud.ply";
  const Eigen::Vector3d middle = middle_of(input);
  const auto in_part = input.frame_from_hole && input.frame == "part"
                           ? std::optional<Eigen::Vector3d>(*input.frame_from_hole * middle)
                           : std::nullopt;
  const bool after_edge = job.part.position == "tower";  // which needs the hole to place the part
  const auto locate = [&]() -> Result<> {
    const auto measured = measured_part(job, stitching, cloud, found.fit, middle);
    if (!measured) return tl::unexpected(measured.error());
    auto part = part_position(job, *measured, in_part);
    if (!part) return fail(std::move(part));
    found.part = *std::move(part);
    return {};
  };
  if (!after_edge) {
    if (auto located = locate(); !located) return fail(std::move(located));
  }
  std::optional<edge::NominalCurve> curve;
  if (input.nominal.kind == edge::NominalKind::kPoints || !input.nominal.size_mm.empty()) {
    auto made = edge::NominalCurve::make(input.nominal);
    if (!made) return fail(std::move(made));
    curve = *std::move(made);
  }
  edge::HoleEdgeOptions options;
  options.masks = masks_of(job, stitching);
  if (curve && !after_edge) {
    // Far enough for the path to say by how much a hole is off that it will not follow.
    constexpr double kReachOfCorrection = 3.0;
    constexpr double kLeastReach_mm = 15.0;
    if (const auto place = placed(input, *curve, found.part, stitching.frame))
      options.expected = edge::ExpectedRim{place->curve, place->frame_from_hole,
                                           std::max(kLeastReach_mm, kReachOfCorrection * job.path.max_correction_mm)};
  }
  auto hole = edge::find_hole_edge(views.stations, options, views.shared, session.progress());
  if (!hole) return fail(std::move(hole));
  found.hole = *std::move(hole);
  found.hole.curve.frame = stitching.frame;
  append(found.hole.warnings, found.warnings);
  auto fit = edge::fit_nominal(found.hole.curve, input.nominal);
  if (fit) {
    append(fit->warnings, found.warnings);
    found.fit = *std::move(fit);
  } else {
    found.warnings.push_back({"nominal_not_fitted", job.hole->nominal, fit.error().message});
  }
  if (after_edge) {
    if (auto located = locate(); !located) return fail(std::move(located));
  }
  append(found.part.warnings, found.warnings);
  std::optional<PlacedNominal> place;
  if (curve) place = placed(input, *curve, found.part, stitching.frame);
  if (!place) {
    if (!found.fit)
      return fail(ErrorCode::kBadInput, fmt::format("the nominal hole does not fit the edge: {}", fit.error().message));
    auto fitted = edge::NominalCurve::make(found.fit->nominal);
    if (!fitted) return fail(std::move(fitted));
    place = PlacedNominal{*std::move(fitted), found.fit->frame_from_hole, found.fit->covariance.topLeftCorner<6, 6>()};
    found.warnings.push_back(
        {"nominal_placed_by_edge", "",
         "nothing says where the nominal lies: it was laid onto the measured edge, so the path's corrections "
         "tell the hole's form and not its place"});
  }
  found.off = edge::deviations(found.hole.curve, place->curve, place->frame_from_hole);
  auto path = edge::tool_path(found.hole.curve, place->curve, place->frame_from_hole, place->cov,
                              path_options(job.path, stitching.frame));
  if (!path) {
    const std::int64_t elsewhere = found.hole.counts.elsewhere;
    if (elsewhere <= found.hole.counts.used) return fail(std::move(path));
    return fail(path.error().code,
                fmt::format("{} ({} edge pixels lie elsewhere than the nominal: is the part where [part] position "
                            "says, and is it this nominal?)",
                            path.error().message, elsewhere));
  }
  found.path = *std::move(path);
  append(found.path.warnings, found.warnings);
  return found;
}

report::EdgeView view_of(const Found& found, const Views& views, const std::string& frame) {
  report::EdgeView view = edge_view(found.hole, found.fit);
  view.off_u_mm.clear();
  view.off_v_mm.clear();
  if (found.off.points.size() == found.hole.curve.points.size()) {
    view.off_from_placed = true;
    for (Eigen::Index i = 0; i < found.off.uv_mm.cols(); ++i) {
      view.off_u_mm.push_back(found.off.uv_mm(0, i));
      view.off_v_mm.push_back(found.off.uv_mm(1, i));
    }
  }
  if (frame == "machine") {
    view.part = report::EdgePart{found.part.source, found.part.machine_from_part, found.part.covariance,
                                 found.part.redundancy > 0 ? std::optional(found.part.sigma0) : std::nullopt};
  }
  view.path = found.path;
  for (const edge::StationView& station : views.stations) add_edge_images(station, found.hole.curve, view);
  return view;
}

}  // namespace

Result<JobEdgeTask> job_edge_task(const Job& job, const fs::path& results) {
  if (!job.hole || job.hole->nominal.empty()) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: the job has no [hole] nominal", job.file.string()));
  }
  std::error_code ignored;
  if (!fs::exists(results / "stitch" / "result.json", ignored)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: the edge is found in stitched scans, and {} does not exist; run 'stitch' first",
                            job.file.string(), (results / "stitch" / "result.json").string()));
  }
  const auto head = scan_head_folder(job, results);
  if (!head) return tl::unexpected(head.error());
  return JobEdgeTask{job, results / "stitch", results / "scan", head->string()};
}

std::vector<fs::path> job_edge_files(const Job& job) {
  std::vector<fs::path> files = part_files(job);
  if (job.hole && !job.hole->nominal.empty() && !edge::outline_of(job.hole->nominal))
    files.push_back(job.resolve(job.hole->nominal));
  if (job.path.gcode_template) files.push_back(job.resolve(*job.path.gcode_template));
  return files;
}

Result<StepOutcome> job_edge_step(const JobEdgeTask& task, const fs::path& out, Session& session) {
  const Job& job = task.job;
  const auto nominal = nominal_input(job);
  if (!nominal) return tl::unexpected(nominal.error());
  const auto stitching = base::read_stitching(task.stitch);
  if (!stitching) return tl::unexpected(stitching.error());
  std::vector<fs::path> files;
  for (const char* name : {"result.json", "covariance.npy", "cloud.ply"}) files.push_back(task.stitch / name);
  for (const base::StitchedStation& station : stitching->stations) {
    for (const char* name : {"result.json", "cloud.ply", "edge_pixels.csv"}) files.push_back(task.scans / station.name / name);
  }
  for (const fs::path& file : job_edge_files(job)) files.push_back(file);
  const ordered_json options = effective_options(job);
  const auto inputs = hashed_inputs(files, job.folder);
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs))
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));

  const auto views = read_views(task, *stitching, session);
  if (!views) return tl::unexpected(views.error());
  const auto found = find(task, *nominal, *stitching, *views, session);
  if (!found) return tl::unexpected(found.error());

  const base::ResultEnvelope envelope{"edge", stitching->frame, *inputs, verdicts_of(job.path, found->hole, found->path),
                                      found->warnings};
  ordered_json body = edge_json(found->hole, found->fit);
  body["off_nominal"] = off_json(found->off);
  if (stitching->frame == "machine") body.update(part_json(found->part));
  body["path"] = path_json(found->path);
  const ordered_json result = base::result_json(envelope, options, body);
  if (auto done = write_edge(folder->path() / "edge.csv", found->hole); !done) return fail(std::move(done));
  const fs::path program = job.path.gcode_template ? job.resolve(*job.path.gcode_template) : fs::path();
  if (auto done = write_path_files(folder->path(), found->path, job.path, program, job.name); !done)
    return fail(std::move(done));
  const std::string html =
      report::edge_report(view_of(*found, *views, stitching->frame),
                          {"Hole edge and path", job.name, envelope, options.dump(2), overview_of(out, session)});
  if (auto published = publish(*folder, html, result); !published) return fail(std::move(published));
  const std::string said = fmt::format("{}; path {:.1f} mm in {:.0f} s", edge_summary(found->hole, found->fit),
                                       found->path.length_mm, found->path.duration_s);
  return StepOutcome{out, said, false, outcome_of(result)};
}

}  // namespace crosstie::app
