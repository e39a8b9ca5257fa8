#include "math/detail/shape_outliers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/distributions.h"

namespace crosstie::math::detail {
namespace {

using base::ErrorCode;
using base::Result;

constexpr int kMaxRounds = 60;
constexpr int kRoundsWithReturn = 40;  // from then on nobody comes back, so that it ends
constexpr Eigen::Index kShareOfRound = 20;

/// Standardised residuals of all points and what they must not exceed.
struct Judgement {
  std::vector<double> w;
  double limit = 0.0;
};

Result<Judgement> judge(const ShapeProblem& problem, double max_w, bool sigma_is_known, const PointSet& points,
                        const ShapeSolution& solution) {
  auto cofactors = shape_cofactors(problem, points, solution.state);
  if (!cofactors) return base::fail(std::move(cofactors));
  const int rows = rows_of(problem.kind);
  const long redundancy = rows * static_cast<long>(points.count()) - static_cast<long>(problem.unknowns().size());
  const double sigma0 = redundancy > 0 ? std::sqrt(solution.square_sum / static_cast<double>(redundancy)) : 0.0;
  const double scale = sigma_is_known ? std::max(1.0, sigma0) : sigma0;
  const double p = 1.0 - 2.0 * normal_cdf(-max_w);
  Judgement judgement;
  if (sigma_is_known) {
    judgement.limit = std::sqrt(chi_square_quantile(p, rows) / rows);
  } else {
    judgement.limit =
        redundancy > rows ? tau_quantile(p, rows, static_cast<double>(redundancy)) : std::numeric_limits<double>::infinity();
  }
  judgement.w.resize(static_cast<std::size_t>(points.xyz.cols()), 0.0);
  if (!(scale > 0.0)) return judgement;
  for (Eigen::Index i = 0; i < points.xyz.cols(); ++i) {
    const double square = standardised_square(problem.kind, solution.state, points, i, *cofactors, points.takes_part(i));
    judgement.w[static_cast<std::size_t>(i)] = std::sqrt(square / rows) / scale;
  }
  return judgement;
}

/// True where somebody went or came back.
bool change_members(const Judgement& judgement, bool may_return, PointSet& points) {
  bool any = false;
  std::vector<std::size_t> leaving;
  for (std::size_t i = 0; i < judgement.w.size(); ++i) {
    const bool fits = judgement.w[i] <= judgement.limit;
    if (points.active[i] != 0 && !fits) leaving.push_back(i);
    if (points.active[i] == 0 && fits && may_return) {
      points.active[i] = 1;
      any = true;
    }
  }
  // The worst first: they make others look bad.
  const auto at_once = static_cast<std::size_t>(std::max<Eigen::Index>(1, points.count() / kShareOfRound));
  const auto worse = [&](std::size_t a, std::size_t b) { return judgement.w[a] > judgement.w[b]; };
  std::stable_sort(leaving.begin(), leaving.end(), worse);
  for (std::size_t i = 0; i < std::min(leaving.size(), at_once); ++i) points.active[leaving[i]] = 0;
  return any || !leaving.empty();
}

}  // namespace

Result<> reject_residuals(const ShapeProblem& problem, double max_w, bool sigma_is_known, PointSet& points, ShapeState& state) {
  if (points.active.empty()) points.active.assign(static_cast<std::size_t>(points.xyz.cols()), 1);
  for (int round = 0; round < kMaxRounds; ++round) {
    if (points.count() < least_points(problem.kind)) {
      return base::fail(ErrorCode::kNoUniqueSolution,
                        "too few points are left for a " + name_of(problem.kind) + " once strays are rejected");
    }
    points.update_centroid();
    const ShapeSolution solution = solve_shape(problem, points, state);
    state = solution.state;
    auto judgement = judge(problem, max_w, sigma_is_known, points, solution);
    if (!judgement) return base::fail(std::move(judgement));
    if (!change_members(*judgement, round < kRoundsWithReturn, points)) return {};
  }
  points.update_centroid();
  return {};
}

}  // namespace crosstie::math::detail
