#include "calib/detail/outliers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "calib/detail/start.h"
#include "math/distributions.h"

namespace crosstie::calib::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Progress;
using base::Result;

constexpr double kUncontrolled = 1e-3;  // redundancy below which a residual says nothing
constexpr int kMaxRounds = 50;
constexpr double kGross = 15.0;  // robust sigmas beyond which a corner does not enter the first adjustment
constexpr double kBadShare = 1.0 / 3.0;

double standardised_residual(const Eigen::Vector2d& residual, const Eigen::Matrix2d& cofactor) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(cofactor);
  double sum = 0.0;
  int rank = 0;
  for (int i = 0; i < 2; ++i) {
    if (eigen.eigenvalues()(i) < kUncontrolled) continue;
    sum += std::pow(eigen.eigenvectors().col(i).dot(residual), 2) / eigen.eigenvalues()(i);
    ++rank;
  }
  return rank > 0 ? std::sqrt(sum / rank) : 0.0;
}

double limit_of(const CalibrateOptions& options, const Problem& problem, const Estimate& at) {
  const double each = options.significance / static_cast<double>(std::max<std::size_t>(1, problem.corners.size()));
  const double redundancy = at.corner_redundancy;
  // A sigma that is given, or at its floor, may be larger than the residuals: they are then no blunders.
  const double factor = std::max(1.0, at.sigma_factor());
  return redundancy > 3.0 ? factor * math::tau_quantile(1.0 - each, 2.0, redundancy) : std::numeric_limits<double>::infinity();
}

/// Corners that are far from where the start values expect them wait outside.
void set_gross_aside(const Problem& problem, State& state) {
  const double limit = std::max(1.0, kGross * robust_sigma_px(problem, state));
  for (std::size_t c = 0; c < problem.corners.size(); ++c) {
    const Corner& corner = problem.corners[c];
    if (!state.takes_part(corner.view)) continue;
    if (distance_px(problem, state, corner) > limit * corner.relative_sigma) state.active[c] = 0;
  }
}

/// Views that would lose too many of their corners; true where one left.
bool drop_bad_views(const Problem& problem, State& state) {
  bool changed = false;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!state.takes_part(static_cast<int>(v))) continue;
    const auto& corners = problem.views[v].corners;
    const auto lost =
        std::count_if(corners.begin(), corners.end(), [&](int c) { return state.active[static_cast<std::size_t>(c)] == 0; });
    if (static_cast<double>(lost) < kBadShare * static_cast<double>(corners.size())) continue;
    state.board_from_camera[v].reset();
    state.view_reasons[v] = fmt::format("{} of its {} corners contradict the other images", lost, corners.size());
    for (const int c : corners) state.active[static_cast<std::size_t>(c)] = 0;
    changed = true;
  }
  return changed;
}

/// Deactivates the largest beyond the limit, at most one of each view and a third of them all.
int reject_largest(const Problem& problem, const std::vector<double>& w, double limit, State& state) {
  std::vector<std::size_t> suspects;
  for (std::size_t c = 0; c < w.size(); ++c) {
    if (state.active[c] && state.takes_part(problem.corners[c].view) && w[c] > limit) suspects.push_back(c);
  }
  std::stable_sort(suspects.begin(), suspects.end(), [&](std::size_t a, std::size_t b) { return w[a] > w[b]; });
  std::vector<char> hit(problem.views.size(), 0);
  const std::size_t most = std::max<std::size_t>(1, suspects.size() / 3);
  std::size_t rejected = 0;
  for (const std::size_t c : suspects) {
    char& view = hit[static_cast<std::size_t>(problem.corners[c].view)];
    if (rejected == most) break;
    if (view) continue;
    view = 1;
    state.active[c] = 0;
    ++rejected;
  }
  return static_cast<int>(rejected);
}

int readmit(const Problem& problem, const std::vector<double>& w, double limit, State& state) {
  int count = 0;
  for (std::size_t c = 0; c < w.size(); ++c) {
    if (state.active[c] || !state.takes_part(problem.corners[c].view) || !(w[c] < limit)) continue;
    state.active[c] = 1;
    ++count;
  }
  return count;
}

}  // namespace

std::vector<double> standardised(const Problem& problem, const State& state, const Estimate& at) {
  std::vector<double> w(problem.corners.size());
  for (std::size_t c = 0; c < w.size(); ++c) {
    const Corner& corner = problem.corners[c];
    if (!state.active[c]) {
      w[c] = distance_px(problem, state, corner) / (std::sqrt(2.0) * state.sigma_px * corner.relative_sigma);
    }
  }
  const auto& cofactors = at.solution.residual_cofactors();
  for (int g = 0; g < at.solution.rows.group_count(); ++g) {
    const int c = at.network.corner_of_measurement[static_cast<std::size_t>(g)];
    if (c < 0) continue;
    w[static_cast<std::size_t>(c)] =
        standardised_residual(at.solution.rows.residual(g), cofactors[static_cast<std::size_t>(g)]);
  }
  return w;
}

Result<Estimate> estimate_without_outliers(const Problem& problem, const CalibrateOptions& options, State& state,
                                           const Progress& progress) {
  const auto settle = [&]() -> Result<Estimate> {
    if (!options.sigma_px) return estimate_with_sigma(problem, state, {}, progress);
    state.sigma_px = *options.sigma_px;
    return estimate(problem, state, {}, 1e-9, progress);
  };
  if (!options.reject_outliers) return settle();
  set_gross_aside(problem, state);
  bool readmitted = false;
  for (int round = 0; round < kMaxRounds; ++round) {
    progress("outliers", static_cast<std::size_t>(round), kMaxRounds);
    drop_bad_views(problem, state);
    auto at = settle();
    if (!at) return at;
    const std::vector<double> w = standardised(problem, state, *at);
    const double limit = limit_of(options, problem, *at);
    if (reject_largest(problem, w, limit, state) > 0) continue;
    if (!readmitted) {
      readmitted = true;
      if (readmit(problem, w, limit, state) > 0) continue;
    }
    progress("outliers", kMaxRounds, kMaxRounds);
    return at;
  }
  return fail(ErrorCode::kNoUniqueSolution,
              "the rejection of outliers does not come to an end; most corners contradict each other");
}

}  // namespace crosstie::calib::detail
