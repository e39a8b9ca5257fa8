#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "math/detail/shape_outliers.h"
#include "math/detail/shape_start.h"

namespace crosstie::math::detail {
namespace {

using base::ErrorCode;
using base::Result;

constexpr Eigen::Index kScored = 600;  // points that judge a sample
constexpr int kSampleDirections = 150;
constexpr double kLargestRadius = 10.0;  // of the points' extent: flat things are no spheres
constexpr int kLocalFits = 4;

double log_choose(double n, double k) { return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0); }

struct Score {
  double log_nfa = std::numeric_limits<double>::infinity();
  double distance = 0.0;  ///< of the farthest point that agrees
};

class Judge {
 public:
  Judge(ShapeKind kind, const PointSet& points, Eigen::Index drawn) : kind_(kind), points_(points), drawn_(drawn) {
    extent_ = 2.0 * (points.xyz.colwise() - points.centroid).colwise().norm().maxCoeff();
    const auto n = static_cast<double>(points.xyz.cols());
    for (Eigen::Index k = 0; k <= points.xyz.cols(); ++k) {
      combinations_.push_back(k < drawn
                                  ? 0.0
                                  : std::log(n - static_cast<double>(drawn) + 1.0) + log_choose(n, static_cast<double>(k)) +
                                        log_choose(static_cast<double>(k), static_cast<double>(drawn)));
    }
  }

  [[nodiscard]] double extent() const { return extent_; }

  [[nodiscard]] Score score(const ShapeState& state) {
    distances_.clear();
    for (Eigen::Index i = 0; i < points_.xyz.cols(); ++i) {
      distances_.push_back(std::abs(shape_residual(kind_, state, points_.xyz.col(i))));
    }
    std::sort(distances_.begin(), distances_.end());
    Score best;
    const double power = rows_of(kind_);
    for (auto k = static_cast<std::size_t>(drawn_) + 1; k <= distances_.size(); ++k) {
      const double distance = std::max(distances_[k - 1], 1e-10 * extent_);
      const double log_p = power * std::log(std::min(1.0, 2.0 * distance / extent_));
      const double log_nfa = combinations_[k] + (static_cast<double>(k) - static_cast<double>(drawn_)) * log_p;
      if (log_nfa < best.log_nfa) best = {log_nfa, distance};
    }
    return best;
  }

 private:
  ShapeKind kind_;
  const PointSet& points_;
  Eigen::Index drawn_;
  double extent_ = 0.0;
  std::vector<double> combinations_;
  std::vector<double> distances_;
};

PointSet drawn_points(const PointSet& points, Eigen::Index count, std::mt19937_64& random) {
  std::vector<Eigen::Index> chosen;
  const auto n = static_cast<std::uint64_t>(points.xyz.cols());
  while (static_cast<Eigen::Index>(chosen.size()) < count) {
    const auto one = static_cast<Eigen::Index>(random() % n);
    if (std::find(chosen.begin(), chosen.end(), one) == chosen.end()) chosen.push_back(one);
  }
  PointSet few;
  few.sigma = points.sigma;
  few.xyz = points.xyz(Eigen::all, chosen);
  few.update_centroid();
  return few;
}

std::vector<char> near_points(ShapeKind kind, const ShapeState& state, const PointSet& points, double distance) {
  std::vector<char> near(static_cast<std::size_t>(points.xyz.cols()), 0);
  for (Eigen::Index i = 0; i < points.xyz.cols(); ++i) {
    near[static_cast<std::size_t>(i)] = std::abs(shape_residual(kind, state, points.xyz.col(i))) <= distance ? 1 : 0;
  }
  return near;
}

}  // namespace

Eigen::Index least_points(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kLine:
      return 2;
    case ShapeKind::kPlane:
    case ShapeKind::kCircle:
      return 3;
    case ShapeKind::kSphere:
      return 4;
    case ShapeKind::kCylinder:
      return 5;
    case ShapeKind::kCone:
      break;
  }
  return 6;
}

Result<ShapeState> consensus(const ShapeProblem& problem, PointSet& points) {
  const ShapeKind kind = problem.kind;
  const bool has_axis_search = kind == ShapeKind::kCylinder || kind == ShapeKind::kCone;
  const Eigen::Index drawn = least_points(kind) + (has_axis_search ? 2 : 0);
  const int trials = has_axis_search ? 250 : 500;
  PointSet scored = points.thinned(kScored);
  if (scored.xyz.cols() <= drawn) {
    return base::fail(
        ErrorCode::kNoUniqueSolution,
        std::to_string(scored.xyz.cols()) + " points are too few to tell those of a " + name_of(kind) + " from strays");
  }
  Judge judge(kind, scored, drawn);
  std::mt19937_64 random(1);
  Score best;
  ShapeState state;
  const auto consider = [&](const std::optional<ShapeSolution>& solution) {
    if (!solution || std::abs(solution->state.size) > kLargestRadius * judge.extent()) return false;
    const Score score = judge.score(solution->state);
    if (!(score.log_nfa < best.log_nfa)) return false;
    best = score;
    state = solution->state;
    return true;
  };
  for (int trial = 0; trial < trials; ++trial) {
    if (!consider(best_solution(problem, drawn_points(scored, drawn, random), kSampleDirections))) continue;
    // A better one: least squares of all that agree with it is better still.
    for (int i = 0; i < kLocalFits; ++i) {
      scored.active = near_points(kind, state, scored, best.distance);
      scored.update_centroid();
      const ShapeSolution solution = solve_shape(problem, scored, state);
      scored.active.clear();
      scored.update_centroid();
      if (!solution.converged || !consider(solution)) break;
    }
  }
  if (!(best.log_nfa < 0.0)) {
    return base::fail(ErrorCode::kNoUniqueSolution,
                      "no " + name_of(kind) + " fits more points than strays would by chance; see whether the file holds one");
  }
  points.active = near_points(kind, state, points, best.distance);
  points.update_centroid();
  return state;
}

}  // namespace crosstie::math::detail
