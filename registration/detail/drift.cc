#include "registration/detail/drift.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>

namespace crosstie::registration::detail {
namespace {

using base::Matrix6d;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// Axial, tangential, radial shift of the station's middle by its own perturbation.
Eigen::Matrix<double, 3, 6> shift_rows(const base::StitchedStation& station) {
  return station.directions_in_machine.transpose() * at_place(station.centre_mm).bottomRows<3>();
}

/// Stations in their order along the direction in which they lie apart.
std::vector<int> order_of(const base::Stitching& result) {
  Vector3d mean = Vector3d::Zero();
  for (const auto& station : result.stations) mean += station.centre_mm / static_cast<double>(result.stations.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const auto& station : result.stations) moments += (station.centre_mm - mean) * (station.centre_mm - mean).transpose();
  const Vector3d along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors().col(2);
  std::vector<int> order(result.stations.size());
  std::iota(order.begin(), order.end(), 0);
  const auto place = [&](int k) { return along.dot(result.stations[static_cast<std::size_t>(k)].centre_mm - mean); };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return place(a) < place(b); });
  if (order.front() > order.back()) std::reverse(order.begin(), order.end());
  return order;
}

}  // namespace

std::vector<base::StitchDrift> find_drift(const StitchWork&, StitchSolution& solution, const base::Stitching& result) {
  const std::vector<int> order = order_of(result);
  const auto from = static_cast<std::size_t>(order.front());
  std::vector<base::StitchDrift> drifts;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const auto to = static_cast<std::size_t>(order[i]);
    base::StitchDrift& drift = drifts.emplace_back();
    drift.from = static_cast<int>(from);
    drift.to = static_cast<int>(to);
    drift.distance_mm = (result.stations[to].centre_mm - result.stations[from].centre_mm).norm();
    Eigen::Matrix<double, 6, 12> relative;
    relative << -Matrix6d::Identity(), Matrix6d::Identity();
    Eigen::Matrix<double, 12, 12> cov;
    const auto a = 6 * static_cast<Index>(from);
    const auto b = 6 * static_cast<Index>(to);
    cov << result.covariance.block<6, 6>(a, a), result.covariance.block<6, 6>(a, b), result.covariance.block<6, 6>(b, a),
        result.covariance.block<6, 6>(b, b);
    const Matrix6d of_motion = relative * cov * relative.transpose();
    const Eigen::Matrix<double, 3, 6> rows = shift_rows(result.stations[to]);
    drift.sigma_mm = (rows * of_motion * rows.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
    drift.free_sigma_mm.setConstant(std::numeric_limits<double>::quiet_NaN());
  }

  // Without list and axis, the first station held.
  math::Model& model = solution.model.model;
  std::vector<std::vector<int>> kept;
  for (const int pose : solution.model.poses) kept.push_back(model.blocks[static_cast<std::size_t>(pose)].free);
  for (std::size_t k = 0; k < kept.size(); ++k) {
    auto& free = model.blocks[static_cast<std::size_t>(solution.model.poses[k])].free;
    if (k == from) {
      free.clear();
    } else {
      free.resize(6);
      std::iota(free.begin(), free.end(), 0);
    }
  }
  if (solution.model.part >= 0) model.blocks[static_cast<std::size_t>(solution.model.part)].free.clear();
  math::WhitenedRows rows;
  std::vector<int> seen(model.blocks.size(), 0);
  bool good = true;
  for (std::size_t g = 0; g < solution.model.groups.size(); ++g) {
    const Source source = solution.model.groups[g].source;
    if (source == Source::kReference || source == Source::kAxis) continue;
    for (const int block : model.measurements[g]->blocks()) ++seen[static_cast<std::size_t>(block)];
    good = good && model.linearise(*model.measurements[g], rows);
  }
  for (const auto& [id, block] : solution.model.points) {
    if (seen[static_cast<std::size_t>(block)] == 0) model.blocks[static_cast<std::size_t>(block)].free.clear();
  }
  const math::Parameters parameters = model.parameters();
  const auto equations = math::NormalEquations::make(parameters, rows, MatrixXd(parameters.size(), 0));
  if (good && equations) {
    for (base::StitchDrift& drift : drifts) {
      const auto to = static_cast<std::size_t>(drift.to);
      MatrixXd functional = MatrixXd::Zero(parameters.size(), 3);
      functional.middleRows<6>(parameters.block(solution.model.poses[to]).offset) = shift_rows(result.stations[to]).transpose();
      drift.free_sigma_mm =
          functional.cwiseProduct(equations->solve(functional)).colwise().sum().cwiseMax(0.0).cwiseSqrt().transpose();
    }
  }
  return drifts;
}

}  // namespace crosstie::registration::detail
