#include "bundle/detail/estimate.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

namespace crosstie::bundle::detail {
namespace {

using base::fail;
using base::Result;

/// Root mean square distance of the points from the origin.
double extent_of(const math::Model& model) {
  double sum = 0.0;
  int count = 0;
  for (const math::Block& block : model.blocks) {
    if (block.kind != math::Block::Kind::kPoint) continue;
    sum += Eigen::Map<const Eigen::Vector3d>(block.values.data()).squaredNorm();
    ++count;
  }
  return count > 0 && sum > 0.0 ? std::sqrt(sum / count) : 1.0;
}

/// How a block moves when the whole network is shifted (3), turned (3) and scaled about the origin.
Eigen::MatrixXd motions_of(const math::Block& block) {
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(block.tangent_size(), 7);
  switch (block.kind) {
    case math::Block::Kind::kVector:
      break;
    case math::Block::Kind::kPoint: {
      const Eigen::Map<const Eigen::Vector3d> point(block.values.data());
      moved << Eigen::Matrix3d::Identity(), -base::skew(point), point;
      break;
    }
    case math::Block::Kind::kPose:
      moved.block<3, 3>(3, 0).setIdentity();
      moved.block<3, 3>(0, 3).setIdentity();
      moved.block<3, 1>(3, 6) = math::pose_from_values(block.values.data()).translation_mm;
      break;
    case math::Block::Kind::kMount:
      moved.block<3, 1>(3, 6) = math::pose_from_values(block.values.data()).translation_mm;
      break;
  }
  return moved;
}

}  // namespace

Eigen::MatrixXd null_space(const NetworkModel& network, const math::WhitenedRows& rows) {
  constexpr double kCancelled = 1e-9;   // a sum this small against its terms is zero
  constexpr double kDetermined = 1e-7;  // least over largest pivot of the motions that known quantities see
  const math::Parameters parameters = network.model.parameters();
  const double extent = extent_of(network.model);
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(parameters.size(), 7);
  std::vector<Eigen::RowVectorXd> seen;
  const auto see = [&](Eigen::RowVectorXd row, const Eigen::RowVectorXd& magnitude) {
    row = (row.array().abs() > kCancelled * magnitude.array()).select(row, 0.0);
    row.tail<4>() /= extent;  // turns and scale by what they move at the network's rim
    if (row.norm() > 0.0) seen.emplace_back(row.normalized());
  };
  for (std::size_t b = 0; b < network.model.blocks.size(); ++b) {
    const math::Block& block = network.model.blocks[b];
    const Eigen::MatrixXd moved = motions_of(block);
    int next = parameters.block(static_cast<int>(b)).offset;
    for (int i = 0; i < block.tangent_size(); ++i) {
      if (std::binary_search(block.free.begin(), block.free.end(), i)) {
        basis.row(next++) = moved.row(i);
      } else if (block.kind != math::Block::Kind::kVector) {
        see(moved.row(i), Eigen::RowVectorXd::Zero(7));
      }
    }
  }
  for (int g = 0; g < rows.group_count(); ++g) {
    if (network.ray_of_group[static_cast<std::size_t>(g)] >= 0) continue;
    const auto terms = rows.terms(g);
    Eigen::MatrixXd product = Eigen::MatrixXd::Zero(rows.group(g).rows, 7);
    Eigen::MatrixXd magnitude = product;
    for (std::size_t t = 0; t < terms.size(); ++t) {
      const auto part = basis.middleRows(parameters.block(terms[t].block).offset, terms[t].size);
      product += rows.jacobian(g, t) * part;
      magnitude += rows.jacobian(g, t).cwiseAbs() * part.cwiseAbs();
    }
    for (Eigen::Index i = 0; i < product.rows(); ++i) see(product.row(i), magnitude.row(i));
  }
  if (seen.empty()) return basis;
  Eigen::MatrixXd all(static_cast<Eigen::Index>(seen.size()), 7);
  for (std::size_t i = 0; i < seen.size(); ++i) all.row(static_cast<Eigen::Index>(i)) = seen[i];
  Eigen::FullPivLU<Eigen::MatrixXd> lu(all);
  lu.setThreshold(kDetermined);
  if (lu.rank() == 7) return Eigen::MatrixXd(parameters.size(), 0);
  Eigen::MatrixXd kernel = lu.kernel();
  kernel.bottomRows<4>() /= extent;
  return basis * kernel;
}

Result<Estimate> estimate(const Survey& survey, State& state, const ModelPlan& plan, const math::SolveOptions& options,
                          const base::Progress& progress) {
  NetworkModel network = build_model(survey, state, plan);
  auto solution = math::solve(
      network.model, [&](const math::Model&, const math::WhitenedRows& rows) { return null_space(network, rows); }, options,
      progress);
  if (!solution) return fail(std::move(solution));
  state.iterations += solution->iterations;
  read_back(survey, network, state);
  return Estimate{std::move(*solution), std::move(network)};
}

}  // namespace crosstie::bundle::detail
