#include "edge/hole_edge.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "edge/detail/camera_miss.h"
#include "edge/detail/chamfer_side.h"
#include "edge/detail/rim_candidates.h"
#include "edge/detail/rim_line.h"
#include "edge/detail/rim_search.h"
#include "edge/detail/view_surface.h"
#include "math/covariance_root.h"
#include "math/distributions.h"
#include "math/head_point.h"
#include "math/median.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using detail::CameraMiss;
using detail::Face;
using detail::RimCandidate;
using detail::RimLine;

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

/// What one camera of one station says of a cell.
struct Voice {
  int station = 0;
  int camera = 0;
  int pixels = 0;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_in_rig_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double off_mm = 0.0;    // from the smooth line, away from the material
  double sigma_mm = 0.0;  // of it
  double surface_sigma_mm = 0.0;
  Eigen::Vector2d tilt_sigma_rad = Eigen::Vector2d::Zero();  // of the normal's tilts, across the rim and along it
  double slant = 0.0;  // by how much a point moves across the rim when its surface moves by one along the normal
  double band_mm = 0.0;
};

/// One point of the rim in the making.
struct Cell {
  std::vector<Voice> voices;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d across = Eigen::Vector3d::Zero();
  double sigma_mm = 0.0;
  double surface_sigma_mm = 0.0;
  Eigen::Vector2d tilt_sigma_rad = Eigen::Vector2d::Zero();
  double slant = 0.0;
  double off_mm = 0.0;
  double disagreement = 1.0;
};

/// Variance of the mean of edge pixels over an extent, each of which averages a piece of edge itself: with white noise along the edge, over that of
/// one pixel. `pieces` is the extent in pieces.
double share_of_variance(double pieces) { return pieces < 1.0 ? 1.0 - pieces / 3.0 : (1.0 - 1.0 / (3.0 * pieces)) / pieces; }

std::vector<Voice> voices_of(const std::vector<const RimCandidate*>& members, const RimLine& line) {
  std::map<std::pair<int, int>, std::vector<const RimCandidate*>> groups;
  for (const RimCandidate* member : members) groups[{member->station, member->camera}].push_back(member);
  std::vector<Voice> voices;
  for (const auto& [who, group] : groups) {
    Voice voice{who.first, who.second, static_cast<int>(group.size())};
    double weights = 0.0, variance = 0.0, extent_low = 1e300, extent_high = -1e300;
    double piece = 0.0, surface_piece = 0.0, depths = 0.0;
    for (const RimCandidate* member : group) {
      const double weight = 1.0 / (member->sigma_mm * member->sigma_mm);
      weights += weight;
      voice.point_mm += weight * member->point_mm;
      voice.point_in_rig_mm += weight * member->point_in_rig_mm;
      voice.normal += weight * member->normal;
      voice.off_mm += weight * line.off_mm(member->point_mm);
      voice.surface_sigma_mm += weight * member->surface_sigma_mm;
      const double facing = std::max(0.1, std::abs(member->ray.dot(member->normal)));
      voice.slant += weight * -member->ray.dot(line.across) / facing;
      voice.tilt_sigma_rad += weight * member->tilt_sigma_rad;
      voice.band_mm += weight * member->band_mm;
      variance += weight * member->sigma_mm * member->sigma_mm;
      const double along = line.along_mm(member->point_mm);
      extent_low = std::min(extent_low, along);
      extent_high = std::max(extent_high, along);
      piece += weight * member->piece_mm;
      surface_piece += weight * member->surface_piece_mm;
      depths += weight * member->depths_mm;
    }
    for (double* value :
         {&voice.off_mm, &voice.surface_sigma_mm, &voice.slant, &voice.band_mm, &piece, &surface_piece, &depths})
      *value /= weights;
    voice.point_mm /= weights;
    voice.point_in_rig_mm /= weights;
    voice.normal.normalize();
    // The mean of points on a curve lies on its inner side.
    voice.point_mm += (voice.off_mm - line.off_mm(voice.point_mm)) * line.across;
    voice.surface_sigma_mm *= std::sqrt(share_of_variance((extent_high - extent_low) / surface_piece));
    voice.tilt_sigma_rad *= std::sqrt(share_of_variance((extent_high - extent_low) / depths)) / weights;
    voice.sigma_mm = std::sqrt(variance / weights * share_of_variance((extent_high - extent_low) / piece));
    voices.push_back(voice);
  }
  return voices;
}

constexpr double kChance = 0.999;

/// Cameras and stations together; those that contradict the others and the neighbours go.
Cell fuse(std::vector<Voice> voices, const RimLine& line, double max_w, HoleEdge::Counts& counts) {
  const auto contradicts = [&](const Voice& a, const Voice& b) {
    return std::abs(a.off_mm - b.off_mm) > max_w * std::hypot(a.sigma_mm, b.sigma_mm, line.scatter_mm);
  };
  for (bool changed = true; changed && voices.size() > 1;) {
    changed = false;
    for (std::size_t i = 0; i < voices.size() && !changed; ++i) {
      for (std::size_t j = i + 1; j < voices.size() && !changed; ++j) {
        if (!contradicts(voices[i], voices[j])) continue;
        const std::size_t worse = std::abs(voices[i].off_mm) > std::abs(voices[j].off_mm) ? i : j;
        counts.stray += voices[worse].pixels;
        counts.used -= voices[worse].pixels;
        voices.erase(voices.begin() + static_cast<std::ptrdiff_t>(worse));
        changed = true;
      }
    }
  }
  Cell cell;
  double weights = 0.0;
  std::map<int, Eigen::Vector3d> by_station;
  for (const Voice& voice : voices) {
    const double weight = 1.0 / (voice.sigma_mm * voice.sigma_mm);
    weights += weight;
    cell.point_mm += weight * voice.point_mm;
    cell.normal += weight * voice.normal;
    cell.off_mm += weight * voice.off_mm;
    by_station.try_emplace(voice.station, Eigen::Vector3d::Zero()).first->second +=
        weight * Eigen::Vector3d(voice.surface_sigma_mm, voice.tilt_sigma_rad(0), voice.tilt_sigma_rad(1));
    cell.slant += weight * voice.slant;
  }
  cell.point_mm /= weights;
  for (double* value : {&cell.off_mm, &cell.slant}) *value /= weights;
  // The cameras of a station stand on the same depths, stations on their own.
  for (const auto& [station, sigmas] : by_station) {
    cell.surface_sigma_mm = std::hypot(cell.surface_sigma_mm, sigmas(0) / weights);
    for (int i = 0; i < 2; ++i) cell.tilt_sigma_rad(i) = std::hypot(cell.tilt_sigma_rad(i), sigmas(i + 1) / weights);
  }
  double squares = 0.0;
  for (const Voice& voice : voices) squares += std::pow((voice.off_mm - cell.off_mm) / voice.sigma_mm, 2);
  const double freedom = static_cast<double>(voices.size()) - 1.0;
  // Only where chance does not explain it: else sigmas would grow on average.
  if (freedom > 0.0 && squares > math::chi_square_quantile(kChance, freedom)) cell.disagreement = squares / freedom;
  cell.sigma_mm = std::sqrt(cell.disagreement / weights);
  // Of the surfaces themselves: a rim says little of the slopes of the face that it lies in.
  cell.normal.normalize();
  cell.across = (line.across - line.across.dot(cell.normal) * cell.normal).normalized();
  cell.voices = std::move(voices);
  return cell;
}

/// The stations' poses, six parameters each, then those of their heads: where they stand and their covariance.
struct SharedParameters {
  std::map<const base::Head*, Eigen::Index> heads;  ///< first parameter of each
  Eigen::MatrixXd cov;
};

Result<SharedParameters> shared_parameters(std::span<const StationView> stations, const SharedKnowledge& shared) {
  SharedParameters parameters;
  Eigen::Index count = 6 * static_cast<Eigen::Index>(stations.size());
  for (const StationView& view : stations) {
    if (parameters.heads.emplace(view.head, count).second) count += view.head->parameter_count();
  }
  const bool fits = shared.cov.rows() == count && shared.cov.cols() == count && parameters.heads.size() == 1;
  const bool change_fits = shared.head_change.size() == 0 || shared.head_change.size() == stations[0].head->parameter_count();
  if ((shared.cov.size() > 0 && !fits) || !change_fits) {
    return fail(ErrorCode::kInternal, fmt::format("hole edge: what {} stations share has {} x {} parameters, {} were expected",
                                                  stations.size(), shared.cov.rows(), shared.cov.cols(), count));
  }
  parameters.cov = shared.cov;
  if (shared.cov.size() > 0) return parameters;
  parameters.cov = Eigen::MatrixXd::Zero(count, count);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    parameters.cov.block<6, 6>(at, at) = stations[i].frame_from_rig_cov;
  }
  for (const auto& [head, at] : parameters.heads) {
    if (head->cov.size() > 0) parameters.cov.block(at, at, head->cov.rows(), head->cov.cols()) = head->cov;
  }
  return parameters;
}

/// A cell's surface as one station saw it, wide enough for its slopes; in the frame.
struct Slope {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt_variance = Eigen::Vector2d::Zero();  ///< across the rim and along it
  double extent_mm = 0.0;                                   ///< of its depths, along the rim
};

std::optional<Slope> slope_at(detail::CameraView& left, const base::Pose& frame_from_rig, const Cell& cell,
                              const HoleEdgeOptions& options) {
  constexpr double kStep_mm = 0.5;
  constexpr double kMostReach_px = 60.0;  // as many pixels tell a slope well enough, and the face of a small bore ends
  const base::Pose rig_from_frame = frame_from_rig.inverse();
  const Eigen::Vector3d across = rig_from_frame.rotation * cell.across;
  const Eigen::Vector3d along = rig_from_frame.rotation * cell.across.cross(cell.normal);
  const Eigen::Vector3d p = rig_from_frame * cell.point_mm;
  const auto at = left.camera().project(p);
  const auto inside = left.camera().project(p - kStep_mm * across);
  const auto beside = left.camera().project(p + kStep_mm * along);
  if (!at || !inside || !beside) return std::nullopt;
  // Square to the edge in the image, as edge pixels have it.
  const Eigen::Vector2d edge = (*beside - *at).normalized();
  Eigen::Vector2d out(-edge.y(), edge.x());
  if (out.dot(*at - *inside) < 0.0) out = -out;
  const double px_per_mm = out.dot(*at - *inside) / kStep_mm;
  const double reach_px = std::clamp(options.normal_reach_mm * px_per_mm, options.surface_reach_px, kMostReach_px);
  Eigen::Matrix3d axes;
  axes << across, along, rig_from_frame.rotation * cell.normal;
  const auto found = detail::slope_before(left, *at, out, options.surface_guard_px, reach_px, p, axes);
  if (!found) return std::nullopt;
  const Eigen::Vector3d normal = axes.col(2) - found->slope(0) * across - found->slope(1) * along;
  return Slope{frame_from_rig.rotation * normal.normalized(), found->cov.diagonal(),
               found->extent_px * kStep_mm / (*beside - *at).norm()};
}

/// Normals of the cells from wide surfaces, where these are known, else of their edge pixels' own; the length of rim that they span, its median.
double turn_normals(std::vector<Cell>& cells, std::span<const StationView> stations, const HoleEdgeOptions& options) {
  std::vector<Eigen::Vector3d> normals(cells.size(), Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector2d> variances(cells.size(), Eigen::Vector2d::Zero());
  std::vector<double> weights(cells.size(), 0.0);
  std::vector<double> extents;
  for (std::size_t s = 0; s < stations.size(); ++s) {
    detail::CameraView left(stations[s].head->left, *stations[s].depth_mm, *stations[s].sigma_mm);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const auto saw = [&](const Voice& voice) { return voice.station == static_cast<int>(s); };
      if (std::none_of(cells[i].voices.begin(), cells[i].voices.end(), saw)) continue;
      const auto slope = slope_at(left, stations[s].frame_from_rig, cells[i], options);
      if (!slope || slope->normal.dot(cells[i].normal) < std::cos(options.max_turn_rad)) continue;
      normals[i] += slope->normal / slope->tilt_variance.sum();
      weights[i] += 1.0 / slope->tilt_variance.sum();
      variances[i] += slope->tilt_variance / std::pow(slope->tilt_variance.sum(), 2);
      extents.push_back(slope->extent_mm);
    }
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (weights[i] == 0.0) continue;
    Cell& cell = cells[i];
    cell.normal = normals[i].normalized();
    cell.tilt_sigma_rad = variances[i].cwiseSqrt() / weights[i];
    cell.across = (cell.across - cell.across.dot(cell.normal) * cell.normal).normalized();
  }
  return extents.empty() ? 0.0 : math::median(extents);
}

/// What the shared parameters do to the points and their normals, as EdgeCurve has it; these tilt towards Cell::across and along across x normal.
struct SharedParts {
  Eigen::MatrixXd points_mm;
  Eigen::MatrixXd tilts_rad;
};

/// Where the head was adjusted, the cells follow.
SharedParts shared_parts(std::vector<Cell>& cells, std::span<const StationView> stations, const SharedParameters& parameters,
                         const Eigen::VectorXd& head_change) {
  constexpr double kBase_mm = 10.0;  // to either side, over which slopes are taken
  const Eigen::MatrixXd causes = math::covariance_root(parameters.cov).root;
  const auto count = static_cast<Eigen::Index>(cells.size());
  SharedParts shared{Eigen::MatrixXd::Zero(3 * count, causes.cols()), Eigen::MatrixXd::Zero(2 * count, causes.cols())};
  if (causes.cols() == 0 && head_change.size() == 0) return shared;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    double weights = 0.0;
    for (const Voice& voice : cells[i].voices) weights += 1.0 / (voice.sigma_mm * voice.sigma_mm);
    Eigen::Matrix3Xd jacobian = Eigen::Matrix3Xd::Zero(3, parameters.cov.cols());
    Eigen::Matrix<double, 2, Eigen::Dynamic> slopes = Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, parameters.cov.cols());
    const Eigen::Vector3d& normal = cells[i].normal;
    const std::array<Eigen::Vector3d, 2> directions = {cells[i].across, cells[i].across.cross(normal)};
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (const Voice& voice : cells[i].voices) {
      const double share = 1.0 / (voice.sigma_mm * voice.sigma_mm) / weights;
      const StationView& view = stations[static_cast<std::size_t>(voice.station)];
      const Eigen::Matrix3d turn = view.frame_from_rig.rotation.toRotationMatrix();
      const Eigen::Matrix3Xd by_head = share * turn * math::point_by_head(*view.head, voice.point_in_rig_mm);
      if (head_change.size() > 0) moved += by_head * head_change;
      const Eigen::Index head = parameters.heads.at(view.head);
      jacobian.middleCols(head, by_head.cols()) += by_head;
      const auto pose = 6 * static_cast<Eigen::Index>(voice.station);
      jacobian.middleCols<3>(pose) -= share * base::skew(voice.point_mm);
      for (Eigen::Index d = 0; d < 2; ++d) {
        const Eigen::Vector3d& direction = directions[static_cast<std::size_t>(d)];
        const Eigen::Vector3d aside = kBase_mm * (turn.transpose() * direction);
        slopes.row(d).segment(head, by_head.cols()) += share / (2.0 * kBase_mm) * (normal.transpose() * turn) *
                                                       (math::point_by_head(*view.head, voice.point_in_rig_mm + aside) -
                                                        math::point_by_head(*view.head, voice.point_in_rig_mm - aside));
        slopes.row(d).segment<3>(pose) -= share * normal.transpose() * base::skew(direction);
      }
      jacobian.middleCols<3>(pose + 3) += share * Eigen::Matrix3d::Identity();
    }
    cells[i].point_mm += moved;
    if (causes.cols() == 0) continue;
    shared.points_mm.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = jacobian * causes;
    shared.tilts_rad.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = -slopes * causes;
  }
  return shared;
}

/// Where the cameras miss each other, both are wrong by as much as one another for all that is known: what they see together is turned about their
/// base by half of the miss, in all stations of a head the same way.
void add_misses(const std::vector<Cell>& cells, std::span<const StationView> stations, const std::vector<CameraMiss>& misses,
                SharedParts& shared) {
  std::map<const base::Head*, Eigen::Index> heads;
  std::map<int, Eigen::Vector3d> turns;  // of each station's rig
  for (const CameraMiss& miss : misses) {
    const base::Head* head = stations[static_cast<std::size_t>(miss.station)].head;
    heads.try_emplace(head, static_cast<Eigen::Index>(heads.size()));
    turns[miss.station] = 0.5 * miss.angle_rad * head->right_from_left.inverse().translation_mm.normalized();
  }
  const auto added = static_cast<Eigen::Index>(heads.size());
  const Eigen::Index before = shared.points_mm.cols();
  shared.points_mm.conservativeResize(Eigen::NoChange, before + added);
  shared.tilts_rad.conservativeResize(Eigen::NoChange, before + added);
  shared.points_mm.rightCols(added).setZero();
  shared.tilts_rad.rightCols(added).setZero();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    double weights = 0.0;
    for (const Voice& voice : cells[i].voices) weights += 1.0 / (voice.sigma_mm * voice.sigma_mm);
    for (const Voice& voice : cells[i].voices) {
      const auto turn = turns.find(voice.station);
      if (turn == turns.end()) continue;
      const StationView& view = stations[static_cast<std::size_t>(voice.station)];
      const double share = 1.0 / (voice.sigma_mm * voice.sigma_mm) / weights;
      const Eigen::Vector3d moved = view.frame_from_rig.rotation * turn->second.cross(voice.point_in_rig_mm);
      const Eigen::Vector3d axis = view.frame_from_rig.rotation * turn->second;
      shared.points_mm.block<3, 1>(3 * row, before + heads.at(view.head)) += share * moved;
      const Eigen::Vector2d slopes(cells[i].normal.dot(axis.cross(cells[i].across)),
                                   cells[i].normal.dot(axis.cross(cells[i].across.cross(cells[i].normal))));
      shared.tilts_rad.block<2, 1>(2 * row, before + heads.at(view.head)) -= share * slopes;
    }
  }
}

/// Scatter of the cells about the line through their neighbours, themselves left out, over what their sigmas say.
double roughness(const std::vector<Cell>& cells, double reach_mm, std::vector<double>& off_mm) {
  constexpr double kMedianOfSquare = 0.4549;  // of chi-square with one degree of freedom
  constexpr std::size_t kLeast = 10;
  off_mm.assign(cells.size(), 0.0);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Eigen::Vector3d tangent = cells[i].across.cross(cells[i].normal);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    int count = 0;
    for (std::size_t j = 0; j < cells.size(); ++j) {
      const Eigen::Vector3d d = cells[j].point_mm - cells[i].point_mm;
      const double a = tangent.dot(d);
      if (j == i || d.norm() > reach_mm) continue;
      const Eigen::Vector3d row(1.0, a, a * a);
      const double weight = 1.0 / (cells[j].sigma_mm * cells[j].sigma_mm);
      normal += weight * row * row.transpose();
      right += weight * cells[i].across.dot(d) * row;
      ++count;
    }
    if (count < 5) continue;
    const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
    const Eigen::Vector3d line = factor.solve(right);
    const double variance = factor.solve(Eigen::Vector3d::UnitX())(0);
    if (!(variance > 0.0)) continue;
    off_mm[i] = -line(0);
    ratios.push_back(line(0) * line(0) / (variance + cells[i].sigma_mm * cells[i].sigma_mm));
  }
  if (ratios.size() < kLeast) return 1.0;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  // The median of so many varies by chance; what it may be without roughness is not counted as such.
  constexpr double kOfMedian = 1.17;  // sigma of a scale from the median of n absolute values, times sqrt(n)
  const double factor = std::sqrt(*middle / kMedianOfSquare);
  return factor > 1.0 + 3.0 * kOfMedian / std::sqrt(static_cast<double>(ratios.size())) ? factor : 1.0;
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
  const auto parameters = shared_parameters(stations, shared);
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
  std::vector<Cell> points;
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
    if (!members.empty()) points.push_back(fuse(voices_of(members, line), line, options.max_w, counts));
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
  result.roughness_factor = roughness(points, cells->reach_mm(), off);
  curve.depths_mm = turn_normals(points, stations, options);
  SharedParts parts = shared_parts(points, stations, *parameters, shared.head_change);
  add_misses(points, stations, misses, parts);
  curve.shared_mm = parts.points_mm;
  curve.shared_tilt_rad = parts.tilts_rad;
  double s = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Cell& here = points[i];
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
