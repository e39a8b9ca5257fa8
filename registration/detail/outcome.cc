#include "registration/detail/outcome.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "math/cofactors.h"
#include "registration/detail/drift.h"
#include "registration/segment.h"

namespace crosstie::registration::detail {
namespace {

using base::fail;
using base::Matrix6d;
using base::Result;
using base::Stitching;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kCellsAlong = 8.0;        // of an overlap's longer side
constexpr double kDisagrees = 2.0;         // normalised: twice what the noise explains
constexpr double kCalibrationMoved = 3.0;  // rms of the standardised change of the head
constexpr int kLeastInCell = 4;            // matches

/// Where the station's cloud, or what it saw of markers, has its middle.
Vector3d centre_of(const StitchWork& work, std::size_t k) {
  const StationScan& station = work.input.stations[k];
  Vector3d centre = Vector3d::Zero();
  if (station.surface) {
    centre = station.surface->centre_mm();
  } else {
    for (const Sighting& sighting : station.markers)
      centre += sighting.p_in_rig_mm / static_cast<double>(station.markers.size());
  }
  return work.state.machine_from_rig[k] * centre;
}

std::vector<std::string> parameter_labels(base::LensModel model) {
  const auto names = base::parameter_names(model);
  const auto units = base::parameter_units(model);
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    labels.push_back(units[i].empty() ? std::string(names[i]) : fmt::format("{} [{}]", names[i], units[i]));
  }
  return labels;
}

double& share_of(base::SourceShares& shares, Source source) {
  switch (source) {
    case Source::kMarkers:
      return shares.markers;
    case Source::kReference:
      return shares.reference;
    case Source::kSurface:
      return shares.surface;
    case Source::kCalibration:
      return shares.calibration;
    case Source::kAxis:
    case Source::kFrame:
      break;
  }
  return shares.axis;
}

/// Rows of the six directions of a station: what they are of the perturbation of its pose.
Matrix6d direction_rows(const Eigen::Matrix3d& axes, const Vector3d& centre) {
  Matrix6d rows = Matrix6d::Zero();
  const Matrix6d about = at_place(centre);
  rows.topRows<3>() = axes.transpose() * about.bottomRows<3>();
  rows.bottomRows<3>() = axes.transpose() * about.topRows<3>();
  return rows;
}

/// Sigma of each direction, and which source its variance stems from: with x = N^-1 u the variance is x'N x = sum over groups of |J x|^2.
void fill_directions(const StitchWork& work, const StitchSolution& at, Stitching& result) {
  const math::Parameters& parameters = at.equations.parameters();
  const auto names = direction_names(result.segment.kind);
  const auto count = static_cast<Index>(result.stations.size());
  MatrixXd functionals = MatrixXd::Zero(parameters.size(), 6 * count);
  for (Index k = 0; k < count; ++k) {
    base::StitchedStation& station = result.stations[static_cast<std::size_t>(k)];
    station.centre_mm = centre_of(work, static_cast<std::size_t>(k));
    station.directions_in_machine = axes_at(result.segment, station.centre_mm);
    const auto& block = parameters.block(at.model.poses[static_cast<std::size_t>(k)]);
    if (block.size() == 0) continue;
    functionals.block<6, 6>(block.offset, 6 * k) = direction_rows(station.directions_in_machine, station.centre_mm).transpose();
  }
  const MatrixXd x = at.equations.solve(functionals);
  const Eigen::RowVectorXd variance = functionals.cwiseProduct(x).colwise().sum();
  std::map<Source, Eigen::RowVectorXd> parts;
  for (int g = 0; g < at.rows.group_count(); ++g) {
    MatrixXd seen = MatrixXd::Zero(at.rows.group(g).rows, x.cols());
    const auto terms = at.rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      seen += at.rows.jacobian(g, t) * x.middleRows(parameters.block(terms[t].block).offset, terms[t].size);
    }
    auto& part = parts.try_emplace(at.model.groups[static_cast<std::size_t>(g)].source, Eigen::RowVectorXd::Zero(x.cols()))
                     .first->second;
    part += seen.colwise().squaredNorm();
  }
  for (Index k = 0; k < count; ++k) {
    base::StitchedStation& station = result.stations[static_cast<std::size_t>(k)];
    for (Index i = 0; i < 6; ++i) {
      base::DirectionKnowledge& direction = station.directions.emplace_back();
      direction.name = names[static_cast<std::size_t>(i)];
      direction.angle = i >= 3;
      const Index column = 6 * k + i;
      direction.sigma = std::sqrt(std::max(0.0, variance(column)));
      if (variance(column) <= 0.0) continue;
      for (const auto& [source, part] : parts) share_of(direction.share, source) += part(column) / variance(column);
    }
  }
}

/// Joint covariance of all poses and the head, with its labels.
Result<> fill_covariance(const StitchWork& work, const StitchSolution& at, Stitching& result) {
  auto cofactors = math::Cofactors::make(at.equations, at.equations.null_space());
  if (!cofactors) return fail(std::move(cofactors));
  const auto count = static_cast<Index>(result.stations.size());
  const Index head = result.head ? result.head->parameter_count() : 0;
  std::vector<int> blocks = at.model.poses;
  if (at.model.shared >= 0) blocks.push_back(at.model.shared);
  const MatrixXd joint = cofactors->joint(blocks);
  // From the free unknowns to all: a held station has none.
  MatrixXd spread = MatrixXd::Zero(6 * count + head, joint.rows());
  Index column = 0;
  for (Index k = 0; k < count; ++k) {
    const int size = at.equations.parameters().block(at.model.poses[static_cast<std::size_t>(k)]).size();
    if (size == 6) spread.block<6, 6>(6 * k, column).setIdentity();
    column += size;
  }
  result.covariance = MatrixXd::Zero(6 * count + head, 6 * count + head);
  if (head > 0) {
    const MatrixXd by_modes = work.modes->head_by_modes();
    spread.bottomRightCorner(head, by_modes.cols()) = by_modes;
    // What the modes leave out keeps the covariance that it had.
    result.covariance.bottomRightCorner(head, head) =
        work.input.commissioned->cov.topLeftCorner(head, head) - by_modes * by_modes.transpose();
  }
  result.covariance += spread * joint * spread.transpose();
  result.covariance = (0.5 * (result.covariance + result.covariance.transpose())).eval();
  const std::array<const char*, 6> parts = {"rx [rad]", "ry [rad]", "rz [rad]", "tx [mm]", "ty [mm]", "tz [mm]"};
  for (Index k = 0; k < count; ++k) {
    base::StitchedStation& station = result.stations[static_cast<std::size_t>(k)];
    station.cov = result.covariance.block<6, 6>(6 * k, 6 * k);
    for (const char* part : parts) result.labels.push_back(fmt::format("station {} {}", station.name, part));
  }
  if (result.head) {
    for (const auto* camera : {&result.head->left, &result.head->right}) {
      const std::string& name = camera == &result.head->left ? result.head->left_name : result.head->right_name;
      for (const std::string& parameter : parameter_labels(camera->model())) {
        result.labels.push_back(fmt::format("camera {} {}", name, parameter));
      }
    }
    for (const char* part : parts) result.labels.push_back(fmt::format("rig {}", part));
    result.head->cov = result.covariance.bottomRightCorner(head, head);
  }
  if (at.model.part >= 0) result.machine_from_part_cov = cofactors->block(at.model.part, at.model.part);
  for (base::StitchedMarker& marker : result.markers) {
    const int block = at.model.points.at(marker.id);
    marker.cov_mm2 = cofactors->block(block, block);
  }
  return {};
}

Result<> fill_head(const StitchWork& work, Stitching& result) {
  if (!work.modes) return {};
  result.head = work.input.commissioned->head;
  base::Head& head = *result.head;
  const Eigen::VectorXd change = work.modes->head_by_modes() * work.state.shared;
  const Index left = base::parameter_count(head.left.model());
  const Index right = base::parameter_count(head.right.model());
  const auto moved = [](const base::Camera& camera, const Eigen::VectorXd& by) {
    return base::Camera::make(camera.model(), camera.width_px(), camera.height_px(), camera.parameters() + by);
  };
  auto left_camera = moved(head.left, change.head(left));
  if (!left_camera) return fail(std::move(left_camera));
  auto right_camera = moved(head.right, change.segment(left, right));
  if (!right_camera) return fail(std::move(right_camera));
  left_camera->set_valid_region(head.left.valid_region_px());
  right_camera->set_valid_region(head.right.valid_region_px());
  head.left = *std::move(left_camera);
  head.right = *std::move(right_camera);
  head.right_from_left = base::perturbed(head.right_from_left, change.tail<6>());
  const Index modes = work.shared_size() - work.modes->frame_size();
  if (modes > 0) result.calibration_shift = work.state.shared.tail(modes).norm() / std::sqrt(static_cast<double>(modes));
  return {};
}

void fill_markers(const StitchWork& work, const StitchSolution& at, Stitching& result) {
  std::map<int, base::StitchedMarker> markers;
  for (const auto& [id, block] : at.model.points) {
    markers[id].id = id;
    markers[id].xyz_mm = work.state.markers.at(id);
  }
  const std::vector<MatrixXd> cofactors = math::residual_cofactors(at.equations, at.rows);
  std::array<double, 2> squares = {0.0, 0.0};
  std::array<double, 2> redundancies = {0.0, 0.0};
  for (std::size_t g = 0; g < at.model.groups.size(); ++g) {
    const StitchGroup& group = at.model.groups[g];
    const Eigen::VectorXd residual = at.rows.residual(static_cast<int>(g));
    if (group.source != Source::kMarkers && group.source != Source::kReference) continue;
    const std::size_t kind = group.source == Source::kMarkers ? 0 : 1;
    squares.at(kind) += residual.squaredNorm();
    redundancies.at(kind) += cofactors[g].trace();
    if (kind == 1) continue;
    const int id =
        work.input.stations[static_cast<std::size_t>(group.station)].markers[static_cast<std::size_t>(group.index)].id;
    base::StitchedMarker& marker = markers.at(id);
    marker.stations.push_back(group.station);
    marker.max_w = std::max(marker.max_w, standardised(residual, cofactors[g]));
    ++result.stations[static_cast<std::size_t>(group.station)].markers;
  }
  if (redundancies[0] > 0.5) result.marker_ratio = squares[0] / redundancies[0];
  if (redundancies[1] > 0.5) result.reference_ratio = squares[1] / redundancies[1];
  if (work.input.reference) {
    const base::Pose part_from_machine = work.state.machine_from_part ? work.state.machine_from_part->inverse() : base::Pose{};
    const base::ControlGroup& points = work.input.reference->points;
    for (std::size_t i = 0; i < points.ids.size(); ++i) {
      const auto marker = markers.find(points.ids[i]);
      if (!work.listed[i] || marker == markers.end()) continue;
      marker->second.in_reference = true;
      marker->second.reference_residual_mm =
          part_from_machine * marker->second.xyz_mm - points.xyz_mm.segment<3>(3 * static_cast<Index>(i));
    }
  }
  for (auto& [id, marker] : markers) result.markers.push_back(std::move(marker));
}

void fill_overlaps(const StitchWork& work, Stitching& result) {
  for (const Overlap& overlap : work.overlaps) {
    base::StitchedOverlap& out = result.overlaps.emplace_back();
    out.a = overlap.a;
    out.b = overlap.b;
    out.matches = static_cast<int>(overlap.matches.size());
    out.not_seen = overlap.not_seen;
    Vector3d least = Vector3d::Constant(std::numeric_limits<double>::infinity());
    Vector3d most = -least;
    for (const Match& match : overlap.matches) {
      least = least.cwiseMin(match.place_mm);
      most = most.cwiseMax(match.place_mm);
    }
    const double size = (most - least).maxCoeff() / kCellsAlong;
    struct Sums {
      Vector3d place = Vector3d::Zero();
      double weight = 0.0;
      double distance = 0.0;
      int count = 0;
    };
    std::map<std::array<int, 3>, Sums> cells;
    Sums all;
    std::vector<double> distances;
    for (std::size_t i = 0; i < overlap.matches.size(); ++i) {
      const Match& match = overlap.matches[i];
      distances.push_back(std::abs(match.distance_mm));
      if (overlap.trust[i] <= 0.0) continue;
      const Vector3d at = (match.place_mm - least) / size;
      const double weight = 1.0 / (match.sigma_mm * match.sigma_mm);
      for (Sums* sums : {&cells[{static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z())}], &all}) {
        sums->place += match.place_mm;
        sums->weight += weight;
        sums->distance += weight * match.distance_mm;
        ++sums->count;
      }
    }
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2), distances.end());
    out.rms_mm = 1.4826 * distances[distances.size() / 2];
    if (all.count == 0) continue;
    out.mean_mm = all.distance / all.weight;
    out.sigma_mm = std::sqrt(work.scale.factor * work.scale.factor / work.scale.independent_share / all.weight);
    double square = 0.0;
    for (const auto& [key, sums] : cells) {
      if (sums.count < kLeastInCell) continue;
      base::OverlapCell& cell = out.cells.emplace_back();
      cell.centre_mm = sums.place / sums.count;
      cell.difference_mm = sums.distance / sums.weight;
      cell.sigma_mm = std::sqrt(1.0 / sums.weight);
      square += std::pow(cell.difference_mm / cell.sigma_mm, 2);
    }
    if (!out.cells.empty()) out.normalised = std::sqrt(square / static_cast<double>(out.cells.size()));
  }
}

Result<> fill_axis(const StitchWork& work, Stitching& result) {
  if (!work.input.commissioned) return {};
  for (std::size_t k = 0; k < result.stations.size(); ++k) {
    base::StitchedStation& station = result.stations[k];
    station.axis_mm = work.input.stations[k].axis_mm;
    if (!station.axis_mm) continue;
    const auto at = work.input.commissioned->frame.at(*station.axis_mm);
    if (!at) return tl::unexpected(at.error());
    station.off_axis = base::difference(at->machine_from_rig, station.machine_from_rig);
    // Of what is known beforehand and of the result: their difference has the difference of the covariances.
    const Matrix6d before = at->cov + at->stop_cov;
    station.off_axis_w = standardised(*station.off_axis, before - station.cov, before);
  }
  return {};
}

void fill_warnings(const StitchWork& work, Stitching& result) {
  const auto name = [&](int k) { return result.stations[static_cast<std::size_t>(k)].name; };
  std::vector<int> overlaps(result.stations.size(), 0);
  for (const base::StitchedOverlap& overlap : result.overlaps) {
    ++overlaps[static_cast<std::size_t>(overlap.a)];
    ++overlaps[static_cast<std::size_t>(overlap.b)];
    if (overlap.normalised > kDisagrees) {
      result.warnings.push_back(
          {"overlap_disagrees", fmt::format("{}, {}", name(overlap.a), name(overlap.b)),
           fmt::format("where both stations see the surface it differs by {:.1f} times what the noise explains; the "
                       "calibration, the part's or the head's movement are possible causes",
                       overlap.normalised)});
    }
  }
  for (std::size_t k = 0; k < overlaps.size(); ++k) {
    if (overlaps[k] == 0 && work.input.stations[k].surface) {
      result.warnings.push_back({"no_overlap", result.stations[k].name,
                                 "its surface overlaps with no other station's; its place stands on markers and axis alone"});
    }
  }
  for (const base::RejectedSighting& rejected : result.rejected) {
    result.warnings.push_back({"marker_rejected",
                               rejected.station < 0 ? fmt::format("marker {}", rejected.id)
                                                    : fmt::format("marker {} at {}", rejected.id, name(rejected.station)),
                               rejected.reason});
  }
  if (result.calibration_shift > kCalibrationMoved) {
    result.warnings.push_back(
        {"calibration_moved", "",
         fmt::format("the head's calibration would have to change by {:.1f} of its sigmas for markers and surfaces to "
                     "agree; check the head (commission --check)",
                     result.calibration_shift)});
  }
  if (static_cast<int>(result.iterations.size()) >= work.options.max_iterations) {
    result.warnings.push_back({"matching_not_settled", "",
                               fmt::format("the matching (ICP) did not come to rest in {} rounds; its pairs were then held",
                                           work.options.max_iterations)});
  }
}

}  // namespace

double standardised(const Eigen::VectorXd& whitened, const MatrixXd& cofactor) {
  constexpr double kUncontrolled = 1e-5;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(cofactor);
  double square = 0.0;
  int rank = 0;
  for (Index i = 0; i < whitened.size(); ++i) {
    if (eigen.eigenvalues()(i) < kUncontrolled) continue;
    square += std::pow(eigen.eigenvectors().col(i).dot(whitened), 2) / eigen.eigenvalues()(i);
    ++rank;
  }
  return rank > 0 ? std::sqrt(square / rank) : 0.0;
}

double standardised(const Eigen::VectorXd& residual, const MatrixXd& cov, const MatrixXd& prior) {
  const Eigen::LLT<MatrixXd> root(prior);
  if (root.info() != Eigen::Success) return 0.0;
  const MatrixXd half = root.matrixL().solve(cov);
  return standardised(root.matrixL().solve(residual), root.matrixL().solve(MatrixXd(half.transpose())));
}

Result<Stitching> outcome(const StitchWork& work, StitchSolution& solution, std::vector<base::StitchIteration> iterations) {
  Stitching result;
  const bool on_axis = work.input.commissioned && std::any_of(work.input.stations.begin(), work.input.stations.end(),
                                                              [](const auto& s) { return s.axis_mm.has_value(); });
  const bool own = work.input.reference && work.input.reference->own_frame;
  result.frame = on_axis || (work.input.reference && !own) ? "machine"
                 : own                                     ? "part"
                                                           : fmt::format("rig of {}", work.input.stations.front().name);
  result.iterations = std::move(iterations);
  result.rejected = work.rejected;
  result.machine_from_part = work.state.machine_from_part;
  result.surface_factor = work.scale.factor;
  result.independent_share = work.scale.independent_share;
  std::vector<Vector3d> points;
  for (std::size_t k = 0; k < work.input.stations.size(); ++k) {
    const StationScan& scan = work.input.stations[k];
    base::StitchedStation& station = result.stations.emplace_back();
    station.name = scan.name;
    station.axis_mm = scan.axis_mm;
    station.machine_from_rig = work.state.machine_from_rig[k];
    if (!scan.surface) continue;
    station.points = static_cast<long>(scan.surface->points());
    for (const SurfacePiece& piece : scan.surface->pieces()) points.push_back(station.machine_from_rig * piece.point_mm);
  }
  result.segment = work.input.segment ? *work.input.segment : fit_segment(points, work.options.threads);
  if (auto filled = fill_head(work, result); !filled) return fail(std::move(filled));
  fill_markers(work, solution, result);
  if (auto filled = fill_covariance(work, solution, result); !filled) return fail(std::move(filled));
  fill_directions(work, solution, result);
  fill_overlaps(work, result);
  if (auto filled = fill_axis(work, result); !filled) return fail(std::move(filled));
  result.drift = find_drift(work, solution, result);
  for (const Overlap& overlap : work.overlaps) result.observations += static_cast<int>(overlap.matches.size());
  for (std::size_t g = 0; g < solution.model.groups.size(); ++g) {
    if (solution.model.groups[g].source != Source::kSurface)
      result.observations += solution.rows.group(static_cast<int>(g)).rows;
  }
  result.unknowns = solution.equations.parameters().size();
  result.redundancy = result.observations - result.unknowns;
  fill_warnings(work, result);
  return result;
}

}  // namespace crosstie::registration::detail
