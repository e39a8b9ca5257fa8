#include "calib/detail/estimate.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "math/cofactors.h"

namespace crosstie::calib::detail {
namespace {

using base::fail;
using base::Result;

/// Splits v'Pv and the redundancy. That of the corners is what the prior leaves: sum over the prior's rows of 1 - j Q j'.
Result<> share_out(Estimate& at) {
  const math::WhitenedRows& rows = at.solution.rows;
  std::vector<int> priors;
  for (int g = 0; g < rows.group_count(); ++g) {
    const double square = rows.residual(g).squaredNorm();
    if (at.network.corner_of_measurement[static_cast<std::size_t>(g)] >= 0) {
      at.corner_square_sum += square;
      at.corner_rows += rows.group(g).rows;
    } else {
      at.prior_square_sum += square;
      priors.push_back(g);
    }
  }
  if (!priors.empty()) {
    const auto cofactors = math::Cofactors::make(at.solution.equations, at.solution.equations.null_space());
    if (!cofactors) return tl::unexpected(cofactors.error());
    for (const int g : priors) {
      const auto terms = rows.terms(g);
      double used = 0.0;
      for (std::size_t s = 0; s < terms.size(); ++s) {
        for (std::size_t t = 0; t < terms.size(); ++t) {
          used +=
              (rows.jacobian(g, s) * cofactors->block(terms[s].block, terms[t].block)).cwiseProduct(rows.jacobian(g, t)).sum();
        }
      }
      at.prior_redundancy += rows.group(g).rows - used;
    }
  }
  at.corner_redundancy = at.solution.redundancy - at.prior_redundancy;
  return {};
}

}  // namespace

double Estimate::sigma_factor() const {
  return corner_redundancy > 0.0 ? std::sqrt(corner_square_sum / corner_redundancy) : 1.0;
}

Result<Estimate> estimate(const Problem& problem, State& state, const ModelPlan& plan, double tolerance,
                          const base::Progress& progress) {
  BoardModel network = build_model(problem, state, plan);
  auto solution = math::solve(network.model, math::no_null_space, {.tolerance = tolerance}, progress);
  if (!solution) return fail(std::move(solution));
  read_back(problem, network, state);
  state.iterations += solution->iterations;
  Estimate at{std::move(network), std::move(*solution)};
  if (auto ok = share_out(at); !ok) return fail(std::move(ok));
  return at;
}

Result<Estimate> estimate_with_sigma(const Problem& problem, State& state, const ModelPlan& plan,
                                     const base::Progress& progress) {
  constexpr int kMaxUpdates = 30;
  constexpr double kSettled = 1e-4;  // of a sigma that is known to some 1e-2
  constexpr double kCoarse = 1e-2;
  constexpr double kFine = 1e-9;
  for (int update = 0;; ++update) {
    auto at = estimate(problem, state, plan, kCoarse, progress);
    if (!at) return at;
    const double factor = at->sigma_factor();
    const bool at_floor = factor < 1.0 && state.sigma_px <= kLeastSigma_px;
    if (std::abs(factor - 1.0) < kSettled || update == kMaxUpdates || at_floor) {
      return estimate(problem, state, plan, kFine, progress);
    }
    state.sigma_px = std::max(kLeastSigma_px, factor * state.sigma_px);
  }
}

}  // namespace crosstie::calib::detail
