#include "math/solution.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "math/cofactors.h"
#include "math/minimise.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kMaxSteps = 15;
constexpr double kConverged = 1e-3;  // of a sigma: a last step of less is rounding, not a minimum that is still far off

/// |J dx|^2: how far a step moves the predictions, in sigmas.
double moved_predictions(const WhitenedRows& rows, const Parameters& parameters, const Eigen::VectorXd& step) {
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
std::string most_moved(const WhitenedRows& rows, const Parameters& parameters, const Eigen::VectorXd& step) {
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

}  // namespace

double Solution::sigma0() const { return redundancy > 0 ? std::sqrt(square_sum / redundancy) : 0.0; }

const std::vector<Eigen::MatrixXd>& Solution::residual_cofactors() const {
  if (residual_cofactors_.empty()) residual_cofactors_ = math::residual_cofactors(equations, rows);
  return residual_cofactors_;
}

Eigen::MatrixXd no_null_space(const Model& model, const WhitenedRows&) { return {model.parameters().size(), 0}; }

Result<Solution> solve(Model& model, const NullSpace& null_space, const SolveOptions& options, const base::Progress& progress) {
  const Parameters parameters = model.parameters();
  const std::vector<Block> start = model.blocks;
  int iterations = 0;
  bool minimise_now = false;
  bool minimised = false;
  double last = std::numeric_limits<double>::infinity();
  const auto start_over = [&] {  // Gauss-Newton went astray: back, and the damped method first
    model.blocks = start;
    minimise_now = true;
  };
  for (int step_number = 0;; ++step_number) {
    if (progress.cancelled()) return base::cancelled("the adjustment");
    if (minimise_now) {
      auto summary = minimise(
          model, {.max_iterations = options.max_iterations, .robust_scale = {}, .function_tolerance = 1e-10}, progress);
      if (!summary) return fail(std::move(summary));
      iterations += summary->iterations;
      minimise_now = false;
      minimised = true;
      step_number = 0;
    }
    WhitenedRows rows;
    if (!model.linearise(rows)) {
      if (!minimised) {
        start_over();
        continue;
      }
      return fail(ErrorCode::kNoUniqueSolution, "the adjustment drives points behind the cameras; the network is too weak");
    }
    auto equations = NormalEquations::make(parameters, rows, null_space(model, rows));
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
      const double square_sum = rows.square_sum();
      const int observations = rows.row_count();
      const int unknowns = parameters.size();
      const int redundancy = observations - unknowns + static_cast<int>(equations->null_space().cols());
      return Solution{std::move(rows), std::move(*equations), square_sum, observations, unknowns, redundancy, moved,
                      iterations};
    }
    if (moved > 2.0 * last && !minimised) {
      start_over();
    } else {
      model.move(step);
    }
    last = moved;
    ++iterations;
  }
}

}  // namespace crosstie::math
