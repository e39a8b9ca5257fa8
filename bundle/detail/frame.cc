#include "bundle/detail/frame.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "math/rigid_alignment.h"

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

std::vector<const Datum*> known_datum(const Survey& survey, const State& state) {
  std::vector<const Datum*> known;
  for (const Datum& datum : survey.datum) {
    if (state.points[static_cast<std::size_t>(datum.point)]) known.push_back(&datum);
  }
  return known;
}

Eigen::Vector3d place_of(const State& state, const Datum& datum) {
  return *state.points[static_cast<std::size_t>(datum.point)];
}

/// The datum points as given and as they lie in the network.
std::vector<math::AlignmentPair> datum_pairs(const Survey& survey, const State& state) {
  std::vector<math::AlignmentPair> pairs;
  for (const Datum* datum : known_datum(survey, state)) {
    math::AlignmentPair& pair = pairs.emplace_back();
    pair.a_mm = datum->xyz_mm;
    pair.b_mm = place_of(state, *datum);
  }
  return pairs;
}

tl::unexpected<base::Error> onto_points_failed(base::Result<math::Alignment> alignment) {
  base::Error error = std::move(alignment.error());
  error.message = "the network cannot be brought onto its datum or control points: " + error.message;
  return tl::unexpected(std::move(error));
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
    const auto pairs = datum_pairs(survey, state);
    if (!survey.control.empty()) {
      auto alignment = math::align(pairs, {.with_scale = true, .weighted = false});
      if (!alignment) return onto_points_failed(std::move(alignment));
      return alignment->scale;
    }
    return base::fail(
        base::ErrorCode::kNoUniqueSolution,
        "nothing determines the scale: of every bar at least one end could not be adjusted; its rays stand among the "
        "rejected ones if the scale is set free");
  }
  std::sort(ratios.begin(), ratios.end());
  return ratios[ratios.size() / 2];
}

base::Result<> move_onto_datum(const Survey& survey, State& state, bool with_scale) {
  constexpr int kMaxSteps = 50;
  const auto alignment = math::align(datum_pairs(survey, state), {.with_scale = with_scale, .weighted = false});
  if (!alignment) return onto_points_failed(std::move(alignment));
  rescale(state, alignment->scale);
  transform(state, alignment->a_from_b);

  // The counting coordinates alone. About their centroid, so that turns and shifts are told apart.
  const int unknowns = with_scale ? 7 : 6;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const Datum* datum : known_datum(survey, state)) centre += place_of(state, *datum);
    centre /= static_cast<double>(known_datum(survey, state).size());
    std::vector<Eigen::Matrix<double, 1, 8>> equations;
    for (const Datum* datum : known_datum(survey, state)) {
      const Eigen::Vector3d arm = place_of(state, *datum) - centre;
      Eigen::Matrix<double, 3, 8> rows;
      rows << Eigen::Matrix3d::Identity(), -base::skew(arm), arm, datum->xyz_mm - place_of(state, *datum);
      for (int axis = 0; axis < 3; ++axis) {
        if (datum->axes[static_cast<std::size_t>(axis)]) equations.emplace_back(rows.row(axis));
      }
    }
    Eigen::MatrixXd all(static_cast<Eigen::Index>(equations.size()), 8);
    for (std::size_t i = 0; i < equations.size(); ++i) all.row(static_cast<Eigen::Index>(i)) = equations[i];
    Eigen::MatrixXd jacobian = all.leftCols(unknowns);
    const Eigen::VectorXd size = jacobian.colwise().norm().cwiseMax(1e-300);
    jacobian = jacobian * size.cwiseInverse().asDiagonal();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(jacobian);
    if (all.rows() < unknowns || qr.rank() < unknowns ||
        std::abs(qr.matrixR()(unknowns - 1, unknowns - 1)) < 1e-6 * std::abs(qr.matrixR()(0, 0))) {
      return base::fail(
          base::ErrorCode::kNoUniqueSolution,
          fmt::format("the datum leaves the frame free: its {} counting coordinates must determine {} directions (3 "
                      "shifts, 3 turns{}); let more coordinates count",
                      all.rows(), unknowns, with_scale ? " and the scale" : ""));
    }
    const Eigen::VectorXd delta = size.cwiseInverse().asDiagonal() * qr.solve(all.col(7));
    const base::Pose to_centre{Eigen::Quaterniond::Identity(), -centre};
    transform(state, to_centre);
    if (with_scale) rescale(state, 1.0 + delta(6));
    const base::Vector6d motion = (base::Vector6d() << delta.segment<3>(3), delta.head<3>() + centre).finished();
    transform(state, base::perturbed(base::Pose{}, motion));
    if (delta.norm() < 1e-13 * std::max(1.0, centre.norm())) break;
  }
  return {};
}

Eigen::MatrixXd inner_conditions(const NetworkModel& network, const Eigen::MatrixXd& null_space) {
  const math::Parameters parameters = network.model.parameters();
  Eigen::MatrixXd conditions = Eigen::MatrixXd::Zero(null_space.rows(), null_space.cols());
  for (const int block : network.point_block) {
    if (block < 0) continue;
    const math::ParameterBlock& point = parameters.block(block);
    conditions.middleRows(point.offset, point.size()) = null_space.middleRows(point.offset, point.size());
  }
  return conditions;
}

Eigen::MatrixXd datum_conditions(const Survey& survey, const NetworkModel& network, const Eigen::MatrixXd& null_space) {
  const math::Parameters parameters = network.model.parameters();
  Eigen::MatrixXd conditions = inner_conditions(network, null_space);
  if (!survey.datum.empty()) conditions.setZero();
  for (const Datum& datum : survey.datum) {
    const int block = network.point_block[static_cast<std::size_t>(datum.point)];
    if (block < 0) continue;
    int row = parameters.block(block).offset;
    for (const int axis : network.model.blocks[static_cast<std::size_t>(block)].free) {
      if (datum.axes[static_cast<std::size_t>(axis)]) conditions.row(row) = null_space.row(row);
      ++row;
    }
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

std::string datum_name(const Survey& survey, const State& state, int conditions) {
  if (conditions == 0) return "control points";
  if (survey.datum.empty()) return "inner constraints over all points";
  std::size_t counting = 0;
  std::size_t points = 0;
  for (const Datum* datum : known_datum(survey, state)) {
    counting += static_cast<std::size_t>(std::count(datum->axes.begin(), datum->axes.end(), true));
    ++points;
  }
  if (counting == static_cast<std::size_t>(conditions)) {
    return fmt::format("minimal: {} fixed coordinates of {} points", counting, points);
  }
  if (counting == 3 * points)
    return fmt::format("inner constraints over {} datum points (best fit to their coordinates)", points);
  return fmt::format("best fit to {} coordinates of {} datum points", counting, points);
}

}  // namespace crosstie::bundle::detail
