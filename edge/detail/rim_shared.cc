#include "edge/detail/rim_shared.h"

#include <array>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "math/covariance_root.h"
#include "math/head_point.h"

namespace crosstie::edge::detail {

using base::ErrorCode;
using base::fail;
using base::Result;

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

SharedParts shared_parts(std::vector<FusedCell>& cells, std::span<const StationView> stations,
                         const SharedParameters& parameters, const Eigen::VectorXd& head_change) {
  constexpr double kBase_mm = 10.0;  // to either side, over which slopes are taken
  const Eigen::MatrixXd causes = math::covariance_root(parameters.cov).root;
  const auto count = static_cast<Eigen::Index>(cells.size());
  SharedParts shared{Eigen::MatrixXd::Zero(3 * count, causes.cols()), Eigen::MatrixXd::Zero(2 * count, causes.cols())};
  if (causes.cols() == 0 && head_change.size() == 0) return shared;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Eigen::Matrix3Xd jacobian = Eigen::Matrix3Xd::Zero(3, parameters.cov.cols());
    Eigen::Matrix<double, 2, Eigen::Dynamic> slopes = Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, parameters.cov.cols());
    const Eigen::Vector3d& normal = cells[i].normal;
    const std::array<Eigen::Vector3d, 2> directions = {cells[i].across, cells[i].across.cross(normal)};
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (const Voice& voice : cells[i].voices) {
      const double share = cells[i].share(voice);
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

void add_misses(const std::vector<FusedCell>& cells, std::span<const StationView> stations,
                const std::vector<CameraMiss>& misses, SharedParts& shared) {
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
    for (const Voice& voice : cells[i].voices) {
      const auto turn = turns.find(voice.station);
      if (turn == turns.end()) continue;
      const StationView& view = stations[static_cast<std::size_t>(voice.station)];
      const double share = cells[i].share(voice);
      const Eigen::Vector3d moved = view.frame_from_rig.rotation * turn->second.cross(voice.point_in_rig_mm);
      const Eigen::Vector3d axis = view.frame_from_rig.rotation * turn->second;
      shared.points_mm.block<3, 1>(3 * row, before + heads.at(view.head)) += share * moved;
      const Eigen::Vector2d slopes(cells[i].normal.dot(axis.cross(cells[i].across)),
                                   cells[i].normal.dot(axis.cross(cells[i].across.cross(cells[i].normal))));
      shared.tilts_rad.block<2, 1>(2 * row, before + heads.at(view.head)) -= share * slopes;
    }
  }
}

}  // namespace crosstie::edge::detail
