#include "bundle/detail/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "bundle/detail/minimise.h"
#include "math/cofactors.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kMaxSteps = 15;
constexpr double kConverged = 1e-3;  // of a sigma: a last step of less is rounding, not a minimum that is still far off

/// |J dx|^2: how far a step moves the predictions, in sigmas.
double moved_predictions(const math::WhitenedRows& rows, const math::Parameters& parameters, const Eigen::VectorXd& step) {
  double sum = 0.0;
  for (int g = 0; g < rows.group_count(); ++g) {
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(rows.group(g).rows);
    const auto terms = rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      moved += rows.jacobian(g, t) * step.segment(parameters.block(terms[t].block).offset, terms[t].size);
    }
    sum += moved.squaredNorm();
  }
  return sum;
}

/// The parameter whose part of a step moves the predictions most.
std::string most_moved(const math::WhitenedRows& rows, const math::Parameters& parameters, const Eigen::VectorXd& step) {
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(step.size());
  for (int g = 0; g < rows.group_count(); ++g) {
    const auto terms = rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      sums.segment(parameters.block(terms[t].block).offset, terms[t].size) +=
          rows.jacobian(g, t).colwise().squaredNorm().transpose();
    }
  }
  Eigen::Index most = 0;
  sums.cwiseProduct(step.cwiseAbs2()).maxCoeff(&most);
  return parameters.label(static_cast<int>(most));
}

/// Root mean square distance of the points from the origin.
double extent_of(const Model& model) {
  double sum = 0.0;
  int count = 0;
  for (const Block& block : model.blocks) {
    if (block.kind != Block::Kind::kPoint) continue;
    sum += Eigen::Map<const Eigen::Vector3d>(block.values.data()).squaredNorm();
    ++count;
  }
  return count > 0 && sum > 0.0 ? std::sqrt(sum / count) : 1.0;
}

/// How a block moves when the whole network is shifted (3), turned (3) and scaled about the origin.
Eigen::MatrixXd motions_of(const Block& block) {
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(block.tangent_size(), 7);
  switch (block.kind) {
    case Block::Kind::kVector:
      break;
    case Block::Kind::kPoint: {
      const Eigen::Map<const Eigen::Vector3d> point(block.values.data());
      moved << Eigen::Matrix3d::Identity(), -base::skew(point), point;
      break;
    }
    case Block::Kind::kPose:
      moved.block<3, 3>(3, 0).setIdentity();
      moved.block<3, 3>(0, 3).setIdentity();
      moved.block<3, 1>(3, 6) = pose_from_values(block.values.data()).translation_mm;
      break;
    case Block::Kind::kMount:
      moved.block<3, 1>(3, 6) = pose_from_values(block.values.data()).translation_mm;
      break;
  }
  return moved;
}

}  // namespace

const std::vector<Eigen::MatrixXd>& Estimate::residual_cofactors() const {
  if (residual_cofactors_.empty()) residual_cofactors_ = math::residual_cofactors(equations, rows);
  return residual_cofactors_;
}

double Estimate::sigma0() const { return redundancy > 0 ? std::sqrt(square_sum / redundancy) : 0.0; }

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
    const Block& block = network.model.blocks[b];
    const Eigen::MatrixXd moved = motions_of(block);
    int next = parameters.block(static_cast<int>(b)).offset;
    for (int i = 0; i < block.tangent_size(); ++i) {
      if (std::binary_search(block.free.begin(), block.free.end(), i)) {
        basis.row(next++) = moved.row(i);
      } else if (block.kind != Block::Kind::kVector) {
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

Result<Estimate> estimate(const Survey& survey, State& state, const ModelPlan& plan, const EstimateOptions& options,
                          const base::Progress& progress) {
  NetworkModel network = build_model(survey, state, plan);
  const math::Parameters parameters = network.model.parameters();
  const std::vector<Block> start = network.model.blocks;
  bool minimise_now = false;
  bool minimised = false;
  double last = std::numeric_limits<double>::infinity();
  const auto start_over = [&] {  // Gauss-Newton went astray: back, and the damped method first
    network.model.blocks = start;
    minimise_now = true;
  };
  for (int step_number = 0;; ++step_number) {
    if (progress.cancelled()) return base::cancelled("the adjustment");
    if (minimise_now) {
      auto summary = minimise(
          network.model, {.max_iterations = options.max_iterations, .robust_scale = {}, .function_tolerance = 1e-10}, progress);
      if (!summary) return fail(std::move(summary));
      state.iterations += summary->iterations;
      minimise_now = false;
      minimised = true;
      step_number = 0;
    }
    math::WhitenedRows rows;
    if (!network.model.linearise(rows)) {
      if (!minimised) {
        start_over();
        continue;
      }
      return fail(ErrorCode::kNoUniqueSolution, "the adjustment drives points behind the cameras; the network is too weak");
    }
    auto equations = math::NormalEquations::make(parameters, rows, null_space(network, rows));
    if (!equations) return fail(std::move(equations));
    const Eigen::VectorXd step = equations->step();
    const double moved = std::sqrt(moved_predictions(rows, parameters, step));
    if (moved < options.tolerance || step_number >= kMaxSteps) {
      if (moved > std::max(kConverged, options.tolerance)) {
        if (!minimised) {
          start_over();
          continue;
        }
        return fail(ErrorCode::kNoUniqueSolution, "the adjustment does not converge: its steps still move " +
                                                      most_moved(rows, parameters, step) +
                                                      "; the observations hardly determine it, or contradict each other");
      }
      read_back(survey, network, state);
      const double square_sum = rows.square_sum();
      const int observations = rows.row_count();
      const int unknowns = parameters.size();
      const int redundancy = observations - unknowns + static_cast<int>(equations->null_space().cols());
      return Estimate{
          std::move(network), std::move(rows), std::move(*equations), square_sum, observations, unknowns, redundancy, moved};
    }
    if (moved > 2.0 * last && !minimised) {
      start_over();
    } else {
      network.model.move(step);
    }
    last = moved;
    ++state.iterations;
  }
}

}  // namespace crosstie::bundle::detail
