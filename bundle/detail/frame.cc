#include "bundle/detail/frame.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

namespace crosstie::bundle::detail {
namespace {

struct Cluster {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  int count = 0;
};

Cluster centre_of(const std::vector<std::optional<Eigen::Vector3d>>& points) {
  Cluster cluster;
  for (const auto& point : points) {
    if (!point) continue;
    cluster.centre += *point;
    ++cluster.count;
  }
  if (cluster.count > 0) cluster.centre /= cluster.count;
  return cluster;
}

}  // namespace

base::Pose principal_frame_from_network(const Survey& survey, const State& state) {
  const Cluster cluster = centre_of(state.points);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double mean_rank = 0.0;
  int rank = 0;
  for (const auto& point : state.points) {
    if (!point) continue;
    scatter += (*point - cluster.centre) * (*point - cluster.centre).transpose();
    mean_rank += rank++;
  }
  mean_rank /= std::max(1, cluster.count);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  Eigen::Vector3d x = eigen.eigenvectors().col(2);
  Eigen::Vector3d z = eigen.eigenvectors().col(0);
  double growth = 0.0;
  rank = 0;
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    if (state.points[p]) growth += (rank++ - mean_rank) * x.dot(*state.points[p] - cluster.centre);
  }
  if (growth < 0.0) x = -x;
  double towards = 0.0;
  for (const auto& pose : state.poses) {
    if (pose) towards += z.dot(pose->translation_mm - cluster.centre);
  }
  if (towards < 0.0) z = -z;
  Eigen::Matrix3d rows;
  rows << x.transpose(), z.cross(x).transpose(), z.transpose();
  const Eigen::Quaterniond rotation(rows);
  return {rotation.normalized(), -(rotation.normalized() * cluster.centre)};
}

base::Result<double> scale_factor(const Survey& survey, const State& state) {
  if (survey.scale_is_free) {
    const Cluster cluster = centre_of(state.points);
    double sum = 0.0;
    for (const auto& point : state.points) sum += point ? (*point - cluster.centre).norm() : 0.0;
    return cluster.count / sum;
  }
  std::vector<double> ratios;
  for (const Bar& bar : survey.bars) {
    const auto& a = state.points[static_cast<std::size_t>(bar.point_a)];
    const auto& b = state.points[static_cast<std::size_t>(bar.point_b)];
    if (bar.bar.role == base::ScaleBarRole::kCheck || !a || !b) continue;
    ratios.push_back(bar.bar.length_at_temperature_mm() / (*a - *b).norm());
  }
  if (ratios.empty()) {
    return base::fail(
        base::ErrorCode::kNoUniqueSolution,
        "nothing determines the scale: of every bar at least one end could not be adjusted; its rays stand among the "
        "rejected ones if the scale is set free");
  }
  std::sort(ratios.begin(), ratios.end());
  return ratios[ratios.size() / 2];
}

Eigen::MatrixXd datum_conditions(const Survey& survey, const NetworkModel& network) {
  const math::Parameters parameters = network.model.parameters();
  Eigen::MatrixXd conditions = null_space(network);
  for (const math::ParameterBlock& block : parameters.blocks()) {
    if (block.role == math::BlockRole::kKept) conditions.middleRows(block.offset, block.size()).setZero();
  }
  if (conditions.cols() < 7) return conditions;
  for (const Bar& bar : survey.bars) {
    if (bar.bar.role != base::ScaleBarRole::kDefines) continue;
    const int a = network.point_block[static_cast<std::size_t>(bar.point_a)];
    const int b = network.point_block[static_cast<std::size_t>(bar.point_b)];
    const auto at = [&](int block) {
      return Eigen::Map<const Eigen::Vector3d>(network.model.blocks[static_cast<std::size_t>(block)].values.data());
    };
    const Eigen::Vector3d along = (at(a) - at(b)).normalized();
    conditions.col(6).setZero();
    conditions.col(6).segment<3>(parameters.block(a).offset) = along;
    conditions.col(6).segment<3>(parameters.block(b).offset) = -along;
  }
  return conditions;
}

}  // namespace crosstie::bundle::detail
