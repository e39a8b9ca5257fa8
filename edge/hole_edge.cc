#include "edge/hole_edge.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "edge/detail/camera_miss.h"
#include "edge/detail/chamfer_side.h"
#include "edge/detail/rim_candidates.h"
#include "edge/detail/rim_fusion.h"
#include "edge/detail/rim_line.h"
#include "edge/detail/rim_normals.h"
#include "edge/detail/rim_search.h"
#include "edge/detail/rim_shared.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using detail::CameraMiss;
using detail::Face;
using detail::FusedCell;
using detail::RimCandidate;
using detail::RimLine;
using detail::Voice;

/// An angle in [from, from + 2 pi).
double turned_to(double angle, double from) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return from + std::fmod(std::fmod(angle - from, kTurn) + kTurn, kTurn);
}

bool in_arc(const HoleEdgeOptions& options, double angle) {
  return !options.arc_rad || turned_to(angle, (*options.arc_rad)[0]) <= turned_to((*options.arc_rad)[1], (*options.arc_rad)[0]);
}

bool is_near(const ExpectedRim& expected, const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d p_in_hole = expected.frame_from_hole.inverse() * point_mm;
  return (expected.nominal.nearest(p_in_hole).point_mm - p_in_hole).norm() <= expected.reach_mm;
}

/// The larger error of a rim, and a sign that the head's calibration is not that of its cameras any more.
base::Warning warning_of(const CameraMiss& miss, std::span<const StationView> stations) {
  const StationView& view = stations[static_cast<std::size_t>(miss.station)];
  const double focal_px = view.head->left.parameters()(0);
  return {
      "cameras_miss", view.name,
      fmt::format(
          "the cameras see the rim {:.2f} px apart across the epipolar lines (sigma {:.2f}, from {}): its points lie "
          "half way, and their shared part holds the other half; the head's calibration is off by that much",
          std::abs(miss.angle_rad) * focal_px, miss.sigma_rad * focal_px,
          miss.places > 0 ? fmt::format("texture of {} places about it", miss.places) : fmt::format("{} places", miss.cells))};
}

/// Why there is nothing between two places of the rim.
std::string gap_reason(const detail::LostEdges& lost, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  std::map<std::string, int> reasons;
  const double length = (to - from).norm();
  for (const auto& [point, reason] : lost) {
    const double along = (point - from).dot(to - from) / (length * length);
    if (along > 0.0 && along < 1.0 && (point - from - along * (to - from)).norm() < length + 10.0) ++reasons[reason];
  }
  std::string best = "no edge of the surface was seen";
  int most = 2;
  for (const auto& [reason, count] : reasons) {
    if (count <= most) continue;
    most = count;
    best = reason;
  }
  return best;
}

}  // namespace

Result<> HoleEdgeOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "hole edge options: " + what); };
  if (roi_px && !((*roi_px)[0] < (*roi_px)[2] && (*roi_px)[1] < (*roi_px)[3]))
    return bad("the region is empty; it is u0,v0,u1,v1 with u0 < u1 and v0 < v1");
  if (!(cell_mm >= 0.0 && std::isfinite(cell_mm))) return bad(fmt::format("cell_mm is {}, it must be 0 or more", cell_mm));
  if (!(surface_guard_px >= 0.0 && surface_reach_px >= surface_guard_px + 5.0))
    return bad(
        fmt::format("the surface is fitted from {} to {} px: at least 5 px are asked for", surface_guard_px, surface_reach_px));
  if (!(normal_reach_mm > 0.0)) return bad(fmt::format("normal_reach_mm is {}, it must be positive", normal_reach_mm));
  if (!(max_off_face_mm > 0.0)) return bad(fmt::format("max_off_face_mm is {}, it must be positive", max_off_face_mm));
  if (!(max_turn_rad > 0.0 && max_turn_rad < 1.5)) return bad(fmt::format("max_turn_rad is {}, not in (0, 1.5)", max_turn_rad));
  if (!(max_w > 0.0)) return bad(fmt::format("max_w is {}, it must be positive", max_w));
  if (expected && !(expected->reach_mm > 0.0))
    return bad(fmt::format("reach_mm is {}, it must be positive", expected->reach_mm));
  if (!(min_gap_cells >= 1.0)) return bad(fmt::format("min_gap_cells is {}, it must be 1 or more", min_gap_cells));
  return {};
}

Result<HoleEdge> find_hole_edge(std::span<const StationView> stations, const HoleEdgeOptions& options,
                                const SharedKnowledge& shared, const base::Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (stations.empty()) return fail(ErrorCode::kNoUniqueSolution, "there is no station to see a rim");
  const auto parameters = detail::shared_parameters(stations, shared);
  if (!parameters) return tl::unexpected(parameters.error());
  HoleEdge result;
  HoleEdge::Counts& counts = result.counts;
  std::vector<RimCandidate> all;
  detail::LostEdges lost;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("edge");
    result.curve.stations.push_back(stations[i].name);
    auto found = detail::candidates_of(stations[i], static_cast<int>(i), options, counts);
    for (const RimCandidate& shadow : found.shadows) lost.emplace_back(shadow.point_mm, "a shadow lies there");
    if (options.expected) {
      const auto dropped =
          std::erase_if(found.rim, [&](const RimCandidate& one) { return !is_near(*options.expected, one.point_mm); });
      counts.elsewhere += static_cast<std::int64_t>(dropped);
    }
    all.insert(all.end(), found.rim.begin(), found.rim.end());
  }
  auto found = detail::find_rim(all, options, counts, lost);
  if (!found) {
    if (counts.elsewhere == 0) return tl::unexpected(found.error());
    return fail(found.error().code,
                fmt::format("{} ({} edge pixels lie elsewhere than the rim is expected: farther than {} mm from it)",
                            found.error().message, counts.elsewhere, options.expected->reach_mm));
  }
  const Face& face = found->face;
  std::vector<RimCandidate>& rim = found->rim;
  std::erase_if(rim, [&](const RimCandidate& candidate) { return !in_arc(options, candidate.angle_rad); });
  auto cells = detail::cells_of(rim, face, options.cell_mm);
  if (!cells) {
    return fail(cells.error().code, fmt::format("{} (in the region: {} elsewhere, {} shadows, {} without surface, {} on other "
                                                "surfaces, {} outer contours, {} masked)",
                                                cells.error().message, counts.elsewhere, counts.shadow, counts.no_surface,
                                                counts.off_face, counts.inwards, counts.masked));
  }
  const bool far_side = detail::take_one_side(*cells, rim) > 0;
  if (far_side) cells = detail::cells_of(rim, face, options.cell_mm, detail::ChamferSide::kFar);
  if (!cells) return tl::unexpected(cells.error());
  std::vector<CameraMiss> misses = detail::camera_misses(*cells);
  detail::take_from_texture(misses, stations, rim);
  for (const CameraMiss& miss : misses) result.warnings.push_back(warning_of(miss, stations));
  if (!misses.empty()) {
    detail::meet_half_way(misses, rim);
    cells = detail::cells_of(rim, face, options.cell_mm, far_side ? detail::ChamferSide::kFar : detail::ChamferSide::kNear);
    if (!cells) return tl::unexpected(cells.error());
  }
  std::vector<FusedCell> points;
  for (std::size_t i = 0; i < cells->size(); ++i) {
    std::vector<const RimCandidate*> members;
    const RimLine line = detail::line_about(*cells, i);
    if (!line.known) continue;
    const detail::RimCell& cell = (*cells)[i];
    for (std::size_t m = 0; m < cell.members.size(); ++m) {
      const RimCandidate* member = cell.members[m];
      const double off = line.off_mm(member->point_mm);
      if (cell.inner[m]) {
        ++counts.inner;
        lost.emplace_back(member->point_mm, "only the far side of a chamfer was seen");
      } else if (std::abs(off) > options.max_w * std::hypot(member->sigma_mm, line.scatter_mm)) {
        ++counts.stray;
        lost.emplace_back(member->point_mm, "edges contradict each other");
      } else {
        members.push_back(member);
        ++counts.used;
      }
    }
    if (!members.empty()) points.push_back(detail::fuse(detail::voices_of(members, line), line, options.max_w, counts));
  }
  if (points.size() < 3) return fail(ErrorCode::kNoUniqueSolution, "the edges in the region do not form a rim");

  // Arc length, beginning after the widest gap.
  const double gap = options.min_gap_cells * cells->cell_mm();
  const auto next = [&](std::size_t i) { return (i + 1) % points.size(); };
  std::size_t widest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto length = [&](std::size_t at) { return (points[next(at)].point_mm - points[at].point_mm).norm(); };
    if (length(i) > length(widest)) widest = i;
  }
  base::EdgeCurve& curve = result.curve;
  curve.closed = (points[next(widest)].point_mm - points[widest].point_mm).norm() <= gap && !options.arc_rad;
  if (!curve.closed) std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(next(widest)), points.end());
  std::vector<double> off;
  result.roughness_factor = detail::roughness(points, cells->reach_mm(), off);
  curve.depths_mm = detail::turn_normals(points, stations, options);
  detail::SharedParts parts = detail::shared_parts(points, stations, *parameters, shared.head_change);
  detail::add_misses(points, stations, misses, parts);
  curve.shared_mm = parts.points_mm;
  curve.shared_tilt_rad = parts.tilts_rad;
  double s = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    FusedCell& here = points[i];
    if (i > 0) {
      const double step = (here.point_mm - points[i - 1].point_mm).norm();
      if (step > gap) curve.gaps.push_back({s, step, gap_reason(lost, points[i - 1].point_mm, here.point_mm)});
      s += step;
    }
    base::EdgePoint point;
    point.s_mm = s;
    point.point_mm = here.point_mm;
    point.normal = here.normal;
    // Across leads away from the material; u = normal x tangent as the noun has it.
    const Eigen::Vector3d ahead =
        i + 1 < points.size() ? points[i + 1].point_mm - here.point_mm : here.point_mm - points[i - 1].point_mm;
    const Eigen::Vector3d tangent = here.across.cross(here.normal);
    const double way = tangent.dot(ahead) < 0.0 ? -1.0 : 1.0;
    point.tangent = way * tangent;
    const Eigen::Vector3d u = way * here.across;
    auto tilts = curve.shared_tilt_rad.middleRows<2>(2 * static_cast<Eigen::Index>(i));
    tilts *= way;
    here.sigma_mm *= result.roughness_factor;
    const Eigen::Vector3d by_surface = here.surface_sigma_mm * (here.normal + here.slant * here.across);
    point.cov_mm2 = here.sigma_mm * here.sigma_mm * u * u.transpose() + by_surface * by_surface.transpose();
    Eigen::Matrix3d whole = point.cov_mm2;
    if (curve.shared_mm.cols() > 0) {
      const auto rows = curve.shared_mm.middleRows(3 * static_cast<Eigen::Index>(i), 3);
      whole += rows * rows.transpose();
    }
    point.sigma_u_mm = std::sqrt(u.dot(whole * u));
    point.sigma_v_mm = std::sqrt(point.normal.dot(whole * point.normal));
    point.tilt_variance_rad2 = here.tilt_sigma_rad.cwiseAbs2();
    point.sigma_tilt_rad = (point.tilt_variance_rad2 + tilts.rowwise().squaredNorm()).cwiseSqrt();
    RimPoint detail_of;
    detail_of.off_neighbours_mm = off[i];
    for (const Voice& voice : here.voices) {
      if (std::find(point.stations.begin(), point.stations.end(), voice.station) == point.stations.end())
        point.stations.push_back(voice.station);
      const auto camera = static_cast<std::size_t>(voice.camera);
      detail_of.pixels[camera] += voice.pixels;
      detail_of.off_mm[camera] = voice.off_mm - here.off_mm;
      detail_of.sigma_mm[camera] = voice.sigma_mm;
      detail_of.band_mm = std::max(detail_of.band_mm, voice.band_mm);
    }
    curve.points.push_back(point);
    result.points.push_back(detail_of);
  }
  curve.length_mm = s + (curve.closed ? (points.front().point_mm - points.back().point_mm).norm() : 0.0);
  if (!curve.closed && !options.arc_rad) {
    curve.gaps.push_back({s, (points.front().point_mm - points.back().point_mm).norm(),
                          gap_reason(lost, points.back().point_mm, points.front().point_mm)});
  }
  return result;
}

}  // namespace crosstie::edge
