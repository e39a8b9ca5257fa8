#include "bundle/detail/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

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

}  // namespace

double Estimate::sigma0() const { return redundancy > 0 ? std::sqrt(square_sum / redundancy) : 0.0; }

Eigen::MatrixXd null_space(const NetworkModel& network) {
  bool scale_known = false;
  for (const int bar : network.bar_of_group) scale_known = scale_known || bar >= 0;
  const math::Parameters parameters = network.model.parameters();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(parameters.size(), scale_known ? 6 : 7);
  for (std::size_t b = 0; b < network.model.blocks.size(); ++b) {
    const Block& block = network.model.blocks[b];
    const int offset = parameters.block(static_cast<int>(b)).offset;
    if (block.kind == Block::Kind::kPose) {
      basis.block<3, 3>(offset + 3, 0).setIdentity();
      basis.block<3, 3>(offset, 3).setIdentity();
      if (!scale_known) basis.block<3, 1>(offset + 3, 6) = pose_from_values(block.values.data()).translation_mm;
    } else if (block.role == math::BlockRole::kEliminated) {
      const Eigen::Map<const Eigen::Vector3d> point(block.values.data());
      basis.block<3, 3>(offset, 0).setIdentity();
      basis.block<3, 3>(offset, 3) = -base::skew(point);
      if (!scale_known) basis.block<3, 1>(offset, 6) = point;
    }
  }
  return basis;
}

Result<Estimate> estimate(const Survey& survey, State& state, const ModelPlan& plan, const EstimateOptions& options,
                          const base::Progress& progress) {
  NetworkModel network = build_model(survey, state, plan);
  const math::Parameters parameters = network.model.parameters();
  const std::vector<Block> start = network.model.blocks;
  bool minimise_now = options.minimise_first;
  bool minimised = false;
  double last = std::numeric_limits<double>::infinity();
  for (int step_number = 0;; ++step_number) {
    if (progress.cancelled()) return base::cancelled("the adjustment");
    if (minimise_now) {
      auto summary = minimise(
          network.model, {.max_iterations = options.max_iterations, .robust_scale = {}, .function_tolerance = 1e-10}, progress);
      if (!summary) return fail(std::move(summary));
      state.iterations += summary->iterations;
      minimise_now = false;
      minimised = true;
    }
    math::WhitenedRows rows;
    if (!network.model.linearise(rows)) {
      if (!minimised) {  // Gauss-Newton went astray: back, and the damped method first
        network.model.blocks = start;
        minimise_now = true;
        continue;
      }
      return fail(ErrorCode::kNoUniqueSolution, "the adjustment drives points behind the cameras; the network is too weak");
    }
    auto equations = math::NormalEquations::make(parameters, rows, null_space(network));
    if (!equations) return fail(std::move(equations));
    const Eigen::VectorXd step = equations->step();
    const double moved = std::sqrt(moved_predictions(rows, parameters, step));
    if (moved < options.tolerance || step_number >= kMaxSteps) {
      if (moved > std::max(1e-3, options.tolerance)) {
        return fail(ErrorCode::kNoUniqueSolution,
                    "the adjustment does not converge; the observations contradict each other or hardly determine the network");
      }
      read_back(network, state);
      auto cofactors = math::residual_cofactors(*equations, rows);
      const double square_sum = rows.square_sum();
      const int observations = rows.row_count();
      const int unknowns = parameters.size();
      const int redundancy = observations - unknowns + static_cast<int>(equations->null_space().cols());
      return Estimate{
          std::move(network), std::move(rows), std::move(*equations), std::move(cofactors), square_sum, observations,
          unknowns,           redundancy};
    }
    if (moved > 2.0 * last && !minimised) {
      network.model.blocks = start;
      minimise_now = true;
    } else {
      network.model.move(step);
    }
    last = moved;
    ++state.iterations;
  }
}

}  // namespace crosstie::bundle::detail
