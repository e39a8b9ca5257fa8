#include "registration/detail/stitch_model.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "math/prior.h"
#include "registration/detail/measurements.h"

namespace crosstie::registration::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kMarkerLeftWeight = 1.0;  // both pixels of a marker are measured alike
constexpr double kStopFloor_mm = 1e-4;     // a stop of which nothing is known to scatter: far below what matters, yet regular
constexpr double kStopFloor_rad = 1e-7;
constexpr double kFree = 1e-10;  // eigenvalue of the scaled normal matrix, as NormalEquationsOptions

/// Ids that at least two things tell of.
std::set<int> told_twice(const StitchWork& work) {
  std::map<int, int> count;
  for (std::size_t k = 0; k < work.input.stations.size(); ++k) {
    for (std::size_t i = 0; i < work.active[k].size(); ++i) {
      if (work.active[k][i]) ++count[work.input.stations[k].markers[i].id];
    }
  }
  if (work.input.reference) {
    for (std::size_t i = 0; i < work.listed.size(); ++i) {
      if (work.listed[i]) ++count[work.input.reference->points.ids[i]];
    }
  }
  std::set<int> ids;
  for (const auto& [id, n] : count) {
    if (n >= 2) ids.insert(id);
  }
  return ids;
}

/// Whether the coordinates of different points of the list are correlated.
bool joint(const base::ControlGroup& points) {
  for (Index i = 0; i < points.cov_mm2.rows(); ++i) {
    for (Index j = 0; j < i; ++j) {
      if (i / 3 != j / 3 && points.cov_mm2(i, j) != 0.0) return true;
    }
  }
  return false;
}

Result<> add_list(const StitchWork& work, StitchModel& result) {
  const base::ControlGroup& points = work.input.reference->points;
  std::vector<int> indices;
  for (std::size_t i = 0; i < points.ids.size(); ++i) {
    if (work.listed[i] && result.points.contains(points.ids[i])) indices.push_back(static_cast<int>(i));
  }
  const bool together = joint(points);
  const std::size_t step = together ? indices.size() : 1;
  for (std::size_t first = 0; first < indices.size(); first += step) {
    const std::vector<int> group(indices.begin() + static_cast<std::ptrdiff_t>(first),
                                 indices.begin() + static_cast<std::ptrdiff_t>(first + step));
    std::vector<int> blocks;
    std::vector<Index> rows;
    for (const int i : group) {
      blocks.push_back(result.points.at(points.ids[static_cast<std::size_t>(i)]));
      for (Index axis = 0; axis < 3; ++axis) rows.push_back(3 * i + axis);
    }
    if (result.part >= 0) blocks.push_back(result.part);
    const MatrixXd cov = points.cov_mm2(rows, rows);
    auto whitening = math::whitening_of(cov, "the list of reference coordinates");
    if (!whitening) return fail(std::move(whitening));
    if (together) {
      result.listed_in_one_group = group;
      result.listed_whitening = *whitening;
    }
    result.model.measurements.push_back(
        std::make_unique<ListedMarkers>(blocks, result.part >= 0, points.xyz_mm(rows), *std::move(whitening)));
    result.groups.push_back({Source::kReference, -1, together ? -1 : group.front()});
  }
  return {};
}

base::Matrix6d stop_whitening(const base::Matrix6d& stop_cov) {
  base::Matrix6d cov = stop_cov;
  cov.diagonal().head<3>().array() += kStopFloor_rad * kStopFloor_rad;
  cov.diagonal().tail<3>().array() += kStopFloor_mm * kStopFloor_mm;
  return cov.llt().matrixL().solve(base::Matrix6d::Identity());
}

}  // namespace

Result<StitchModel> build_model(const StitchWork& work) {
  StitchModel result;
  math::Model& model = result.model;
  const auto& stations = work.input.stations;
  for (std::size_t k = 0; k < stations.size(); ++k) {
    math::Block block = math::pose_block("station " + stations[k].name, work.state.machine_from_rig[k]);
    if (k == 0 && work.state.datum_is_first) block.free.clear();
    result.poses.push_back(model.add(std::move(block)));
  }
  if (work.state.machine_from_part) result.part = model.add(math::pose_block("list of markers", *work.state.machine_from_part));
  if (work.shared_size() > 0) {
    math::Block block;
    block.name = "shared";
    block.kind = math::Block::Kind::kVector;
    block.values.assign(work.state.shared.data(), work.state.shared.data() + work.state.shared.size());
    for (int i = 0; i < work.shared_size(); ++i) {
      block.components.push_back(fmt::format("mode {}", i + 1));
      block.free.push_back(i);
    }
    result.shared = model.add(std::move(block));
  }
  for (const int id : told_twice(work)) {
    result.points[id] = model.add(math::point_block(fmt::format("marker {}", id), work.state.markers.at(id)));
  }

  for (std::size_t k = 0; k < stations.size(); ++k) {
    for (std::size_t i = 0; i < stations[k].markers.size(); ++i) {
      const Sighting& sighting = stations[k].markers[i];
      const auto point = result.points.find(sighting.id);
      if (!work.active[k][i] || point == result.points.end()) continue;
      const Eigen::LLT<Eigen::Matrix3d> root(sighting.cov_mm2);
      if (root.info() != Eigen::Success) {
        return fail(ErrorCode::kBadInput, fmt::format("station '{}': the covariance of marker {} is not positive definite",
                                                      stations[k].name, sighting.id));
      }
      std::vector<int> blocks = {result.poses[k], point->second};
      Eigen::Matrix3Xd by_shared = Eigen::Matrix3Xd::Zero(3, 0);
      if (work.modes) {
        blocks.push_back(result.shared);
        by_shared = work.modes->point_by_modes(sighting.p_in_rig_mm, kMarkerLeftWeight);
      }
      model.measurements.push_back(std::make_unique<MarkerSighting>(
          blocks, sighting.p_in_rig_mm, root.matrixL().solve(Eigen::Matrix3d::Identity()), std::move(by_shared)));
      result.groups.push_back({Source::kMarkers, static_cast<int>(k), static_cast<int>(i)});
    }
  }
  if (work.input.reference) {
    if (auto added = add_list(work, result); !added) return fail(std::move(added));
  }
  if (work.modes) {
    for (std::size_t k = 0; k < stations.size(); ++k) {
      if (!stations[k].axis_mm) continue;
      const auto at = work.input.commissioned->frame.at(*stations[k].axis_mm);
      if (!at) return tl::unexpected(at.error());
      model.measurements.push_back(std::make_unique<AxisStop>(result.poses[k], result.shared, at->machine_from_rig,
                                                              work.modes->pose_by_modes(*stations[k].axis_mm),
                                                              stop_whitening(at->stop_cov)));
      result.groups.push_back({Source::kAxis, static_cast<int>(k), -1});
    }
    const Index size = work.shared_size();
    const Index frame = work.modes->frame_size();
    const MatrixXd unit = MatrixXd::Identity(size, size);
    const auto add_prior = [&](const MatrixXd& whitening, Source source) {
      if (whitening.rows() == 0) return;
      model.measurements.push_back(std::make_unique<math::Prior>(
          std::vector<int>{result.shared}, std::vector<int>{static_cast<int>(size)}, Eigen::VectorXd::Zero(size), whitening));
      result.groups.push_back({source, -1, -1});
    };
    add_prior(unit.topRows(frame), Source::kFrame);
    add_prior(unit.bottomRows(size - frame), Source::kCalibration);
  }
  for (std::size_t o = 0; o < work.overlaps.size(); ++o) {
    const Overlap& overlap = work.overlaps[o];
    std::vector<int> blocks = {result.poses[static_cast<std::size_t>(overlap.a)],
                               result.poses[static_cast<std::size_t>(overlap.b)]};
    if (result.shared >= 0) blocks.push_back(result.shared);
    ReducedOverlap reduced = reduce(overlap, work.scale, overlap_by_shared(work, overlap));
    // The matches' distances are those at the present z.
    if (result.shared >= 0) reduced.offset -= reduced.root.rightCols(work.shared_size()) * work.state.shared;
    model.measurements.push_back(std::make_unique<OverlapFactor>(blocks, std::move(reduced.root), std::move(reduced.offset)));
    result.groups.push_back({Source::kSurface, -1, static_cast<int>(o)});
  }
  return result;
}

void read_back(const StitchModel& model, StitchState& state) {
  const auto values = [&](int block) { return model.model.blocks[static_cast<std::size_t>(block)].values.data(); };
  for (std::size_t k = 0; k < model.poses.size(); ++k) {
    state.machine_from_rig[k] = math::pose_from_values(values(model.poses[k]));
    state.machine_from_rig[k].rotation.normalize();
  }
  if (model.part >= 0) state.machine_from_part = math::pose_from_values(values(model.part));
  if (model.shared >= 0) state.shared = Eigen::Map<const Eigen::VectorXd>(values(model.shared), state.shared.size());
  for (const auto& [id, block] : model.points) state.markers[id] = Eigen::Map<const Vector3d>(values(block));
}

MatrixXd overlap_by_shared(const StitchWork& work, const Overlap& overlap) {
  const auto count = static_cast<Index>(overlap.matches.size());
  MatrixXd result = MatrixXd::Zero(count, work.shared_size());
  if (!work.modes || work.piece_by_shared.empty()) return result;
  const auto a = static_cast<std::size_t>(overlap.a);
  const auto b = static_cast<std::size_t>(overlap.b);
  const Eigen::Matrix3d frame_from_a = work.state.machine_from_rig[a].rotation.toRotationMatrix();
  const Eigen::Matrix3d frame_from_b = work.state.machine_from_rig[b].rotation.toRotationMatrix();
  for (Index i = 0; i < count; ++i) {
    const Match& match = overlap.matches[static_cast<std::size_t>(i)];
    const Vector3d in_a = frame_from_a.transpose() * match.normal;
    const Vector3d in_b = frame_from_b.transpose() * match.normal;
    result.row(i) = (work.piece_by_shared[a].middleCols<3>(3 * match.a).cast<double>() * in_a -
                     work.piece_by_shared[b].middleCols<3>(3 * match.b).cast<double>() * in_b)
                        .transpose();
  }
  return result;
}

base::Error explain_free(const StitchWork& work, const StitchModel& model) {
  math::WhitenedRows rows;
  if (!model.model.linearise(rows)) return {ErrorCode::kInternal, "stitch: an observation cannot be predicted"};
  const math::Parameters parameters = model.model.parameters();
  const Index size = parameters.size();
  MatrixXd normal = MatrixXd::Zero(size, size);
  for (int g = 0; g < rows.group_count(); ++g) {
    const auto terms = rows.terms(g);
    for (std::size_t s = 0; s < terms.size(); ++s) {
      for (std::size_t t = 0; t < terms.size(); ++t) {
        normal.block(parameters.block(terms[s].block).offset, parameters.block(terms[t].block).offset, terms[s].size,
                     terms[t].size) += rows.jacobian(g, s).transpose() * rows.jacobian(g, t);
      }
    }
  }
  const Eigen::VectorXd scale = normal.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * normal * scale.asDiagonal());
  const auto free = (eigen.eigenvalues().array() < kFree).count();
  const MatrixXd motions = scale.asDiagonal() * eigen.eigenvectors().leftCols(free);
  std::vector<std::string> said;
  for (std::size_t k = 0; k < model.poses.size(); ++k) {
    const auto& block = parameters.block(model.poses[k]);
    const auto& surface = work.input.stations[k].surface;
    if (block.size() == 0) continue;
    std::vector<Vector3d> places;
    if (surface) {
      for (const SurfacePiece& piece : surface->pieces()) places.push_back(work.state.machine_from_rig[k] * piece.point_mm);
    } else {
      for (const Sighting& sighting : work.input.stations[k].markers) {
        places.push_back(work.state.machine_from_rig[k] * sighting.p_in_rig_mm);
      }
    }
    if (places.size() < 3) continue;
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& place : places) centre += place / static_cast<double>(places.size());
    const base::Matrix6d gram = shift_gram(places, centre);
    const MatrixXd about = at_place(centre) * motions.middleRows(block.offset, 6);
    if (free == 0 || (about.transpose() * gram * about).diagonal().maxCoeff() <= 0.0) continue;
    const auto names = names_of(motions_at(work.segment, centre), about, gram);
    said.push_back(fmt::format("'{}' in {}", work.input.stations[k].name, fmt::join(names, " and ")));
    if (said.size() == 3) break;
  }
  if (said.empty()) return {ErrorCode::kNoUniqueSolution, "stitch: the observations do not determine the stations' places"};
  const bool has_shape = work.segment.kind != base::Segment::Kind::kNone;
  return {
      ErrorCode::kNoUniqueSolution,
      fmt::format(
          "nothing holds station {}: {} moves within itself in {}; three common markers, a list of their coordinates or the "
          "reading of a commissioned axis would hold it",
          fmt::join(said, ", station "),
          has_shape ? fmt::format("a {}", base::segment_name(work.segment.kind)) : std::string("the surface"),
          said.size() == 1 ? "this direction" : "these directions")};
}

}  // namespace crosstie::registration::detail
