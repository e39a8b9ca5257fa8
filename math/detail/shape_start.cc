#include "math/detail/shape_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "math/detail/sphere_search.h"

namespace crosstie::math::detail {
namespace {

constexpr std::size_t kTriedDirections = 16;  // directions of the search that are refined
constexpr std::size_t kStarts = 6;            // of these, minima that become starts
constexpr double kApart_rad = 0.2;            // directions that are refined lie so far apart at least
constexpr double kSame_rad = 0.02;            // minima nearer than this are the same
constexpr int kCoarser = 16;                  // directions searched for each one that is tried anyhow
constexpr double kExactSquare = 1e-20;        // mean square distance of points that a shape passes through
constexpr Eigen::Index kGlanced = 200;        // points and steps with which all starts are compared
constexpr int kGlanceSteps = 12;
constexpr Eigen::Index kThinned = 1500;  // points and steps with which the best of them are
constexpr int kThinnedSteps = 100;

/// |x - c|^2 = r^2 in the span of the given directions after Taubin: the mean square distance (to first order), and c, r.
struct Round {
  double mean_square = 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

template <int Dimensions>
Round taubin(const Moments& moments, const Eigen::Matrix<double, 3, Dimensions>& span) {
  using Functional = Moments::Functional;
  const Eigen::Vector3d mean = moments.centroid();
  // Coordinates and squared length about the centroid, as functionals of the absolute ones.
  std::array<Functional, Dimensions> coordinate;
  Eigen::Matrix3d projector = Eigen::Matrix3d::Zero();
  for (int i = 0; i < Dimensions; ++i) {
    const auto at = static_cast<std::size_t>(i);
    coordinate[at] = Moments::linear(span.col(i)) - span.col(i).dot(mean) * Moments::constant();
    projector += span.col(i) * span.col(i).transpose();
  }
  Functional square = Moments::quadratic(projector) - 2.0 * Moments::linear(projector * mean) +
                      mean.dot(projector * mean) * Moments::constant();
  const double mean_square = std::max(moments.mean(square), 1e-300);
  square -= mean_square * Moments::constant();
  const double scale = 2.0 * std::sqrt(mean_square);
  Eigen::Matrix<double, Dimensions + 1, Dimensions + 1> matrix;
  matrix(0, 0) = moments.mean(square, square) / (scale * scale);
  for (int i = 0; i < Dimensions; ++i) {
    const Functional& x = coordinate[static_cast<std::size_t>(i)];
    matrix(0, i + 1) = matrix(i + 1, 0) = moments.mean(square, x) / scale;
    for (int j = 0; j < Dimensions; ++j) matrix(i + 1, j + 1) = moments.mean(x, coordinate[static_cast<std::size_t>(j)]);
  }
  const Eigen::SelfAdjointEigenSolver<decltype(matrix)> eigen(matrix);
  const auto vector = eigen.eigenvectors().col(0);
  Round round;
  round.mean_square = std::max(eigen.eigenvalues()(0), 0.0);
  double a = vector(0) / scale;
  if (std::abs(a) < 1e-6) a = std::copysign(1e-6, a);  // a straight one: a very large radius to start from
  const Eigen::Matrix<double, Dimensions, 1> b = vector.template tail<Dimensions>();
  const Eigen::Matrix<double, Dimensions, 1> centre = -b / (2.0 * a);
  round.centre = mean + span * centre;
  round.radius = std::sqrt(centre.squaredNorm() + mean_square);
  return round;
}

/// A surface of revolution rho^2 = A + B h + C h^2 about an axis through c along `direction`, of which cones are a part.
struct Revolution {
  double mean_square = 0.0;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();  ///< of the origin on the axis
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
};

Revolution revolution(const Moments& moments, const Eigen::Vector3d& direction) {
  const Eigen::Matrix3d axes = axes_along(direction);
  const Eigen::Matrix3d along = axes.col(2) * axes.col(2).transpose();
  const std::array<Moments::Functional, 5> basis = {Moments::linear(axes.col(0)), Moments::linear(axes.col(1)),
                                                    Moments::constant(), Moments::linear(axes.col(2)),
                                                    Moments::quadratic(along)};
  const Moments::Functional target = Moments::quadratic(Eigen::Matrix3d::Identity() - along);
  Eigen::Matrix<double, 5, 5> gram;
  Eigen::Matrix<double, 5, 1> right;
  for (std::size_t i = 0; i < basis.size(); ++i) {
    right(static_cast<Eigen::Index>(i)) = moments.mean(target, basis[i]);
    for (std::size_t j = 0; j < basis.size(); ++j) {
      gram(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = moments.mean(basis[i], basis[j]);
    }
  }
  gram.diagonal() *= 1.0 + 1e-12;
  const Eigen::Matrix<double, 5, 1> x = gram.ldlt().solve(right);
  Revolution result;
  const Eigen::Vector3d centre = 0.5 * (x(0) * axes.col(0) + x(1) * axes.col(1));
  result.foot = centre;
  result.a = x(2) + centre.squaredNorm();
  result.b = x(3);
  result.c = x(4);
  const double misfit = std::max(moments.mean(target, target) - x.dot(right), 0.0);
  const double rho2 = std::max(moments.mean(target) - 2.0 * moments.centroid().dot(centre) + centre.squaredNorm(), 1e-300);
  result.mean_square = misfit / (4.0 * rho2 * (1.0 + std::max(result.c, 0.0)));
  return result;
}

ShapeState cone_of(const Revolution& surface, const Eigen::Vector3d& direction) {
  const double radius = std::sqrt(std::max(surface.a, 1e-6));
  // From the slope at the origin, or where the origin is near the apex from the asymptote.
  const double slope = surface.c > 0.0 ? std::copysign(std::sqrt(surface.c), surface.b) : surface.b / (2.0 * radius);
  ShapeState state;
  state.axes = axes_along(direction);
  state.origin = surface.foot;
  state.angle = std::atan(slope);
  state.size = radius * std::cos(state.angle);
  return state;
}

/// Where axes may lie: minima of an algebraic misfit over the directions, the lowest first, and some more.
std::vector<Eigen::Vector3d> axis_directions(const std::function<double(const Eigen::Vector3d&)>& misfit, int directions,
                                             const Eigen::Matrix3d& principal) {
  std::vector<Eigen::Vector3d> lattice = lattice_directions(directions, true);
  std::vector<DirectionMinimum> all;
  for (const Eigen::Vector3d& direction : lattice) all.push_back({direction, misfit(direction)});
  const auto lower = [](const DirectionMinimum& a, const DirectionMinimum& b) { return a.value < b.value; };
  std::stable_sort(all.begin(), all.end(), lower);
  const auto is_apart = [](const std::vector<DirectionMinimum>& others, const Eigen::Vector3d& direction, double apart_rad) {
    return std::none_of(others.begin(), others.end(), [&](const DirectionMinimum& other) {
      return std::abs(other.direction.dot(direction)) > std::cos(apart_rad);
    });
  };
  const double spacing_rad = std::sqrt(2.0 * std::numbers::pi / directions);
  std::vector<DirectionMinimum> tried;
  std::vector<DirectionMinimum> minima;
  for (const DirectionMinimum& one : all) {
    if (tried.size() == kTriedDirections) break;
    if (!is_apart(tried, one.direction, kApart_rad)) continue;
    tried.push_back(one);
    minima.push_back(refined_direction(misfit, one.direction, spacing_rad, spacing_rad / 20.0));
  }
  std::stable_sort(minima.begin(), minima.end(), lower);
  std::vector<DirectionMinimum> distinct;
  for (const DirectionMinimum& one : minima) {
    if (distinct.size() < kStarts && is_apart(distinct, one.direction, kSame_rad)) distinct.push_back(one);
  }
  std::vector<Eigen::Vector3d> found;
  for (const DirectionMinimum& one : distinct) found.push_back(one.direction);
  for (int i = 0; i < 3; ++i) found.push_back(principal.col(i));
  // An algebraic misfit may mislead (flat and slender cones): what it does not like is tried here and there, too.
  for (const Eigen::Vector3d& direction : lattice_directions(directions / kCoarser, true)) found.push_back(direction);
  return found;
}

ShapeState round_state(const Round& round, const Eigen::Matrix3d& axes) {
  ShapeState state;
  state.axes = axes;
  state.origin = round.centre;
  state.size = round.radius;
  return state;
}

/// With a known radius: the centre or axis so far from the points that the surface passes them on either side.
std::vector<ShapeState> with_size(const std::vector<ShapeState>& states, double size, const Eigen::Vector3d& centroid) {
  std::vector<ShapeState> all;
  for (ShapeState state : states) {
    const Eigen::Vector3d inwards = state.origin - centroid;
    const double distance = inwards.norm();
    const double radius = state.size;
    state.size = size;
    all.push_back(state);
    if (distance < 0.3 * radius) continue;
    for (const double side : {1.0, -1.0}) {
      state.origin = centroid + inwards * (side * (distance + size - radius) / distance);
      all.push_back(state);
    }
  }
  return all;
}

bool is_same_shape(const ShapeState& a, const ShapeState& b) {
  return std::abs(a.axes.col(2).dot(b.axes.col(2))) > std::cos(kSame_rad) &&
         std::abs(a.size - b.size) < kSame_rad * std::abs(b.size);
}

/// Those that a few steps with a few points bring lowest.
std::vector<ShapeState> most_promising(const ShapeProblem& problem, const PointSet& few,
                                       const std::vector<ShapeState>& starts) {
  std::vector<ShapeSolution> tried;
  for (const ShapeState& start : starts) tried.push_back(solve_shape(problem, few, start, kGlanceSteps));
  std::stable_sort(tried.begin(), tried.end(),
                   [](const ShapeSolution& a, const ShapeSolution& b) { return a.square_sum < b.square_sum; });
  std::vector<ShapeState> best;
  for (const ShapeSolution& one : tried) {
    const auto is_same = [&](const ShapeState& other) { return is_same_shape(other, one.state); };
    if (best.size() < kStarts && std::none_of(best.begin(), best.end(), is_same)) best.push_back(one.state);
  }
  return best;
}

/// With as many points as unknowns several shapes may pass through all of them: the one to which most starts lead.
std::optional<ShapeSolution> most_frequent(const ShapeProblem& problem, const PointSet& few,
                                           const std::vector<ShapeState>& starts) {
  struct Candidate {
    ShapeSolution solution;
    int votes = 0;
  };
  const double exact = kExactSquare * static_cast<double>(few.xyz.cols()) / (few.sigma * few.sigma);
  std::vector<Candidate> candidates;
  std::optional<ShapeSolution> fallback;
  for (const ShapeState& start : starts) {
    const ShapeSolution solution = solve_shape(problem, few, start, kThinnedSteps);
    if (!fallback || solution.square_sum < fallback->square_sum) fallback = solution;
    if (!solution.converged || solution.square_sum > exact) continue;
    const auto same = std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& candidate) {
      return is_same_shape(candidate.solution.state, solution.state);
    });
    if (same == candidates.end()) {
      candidates.push_back({solution, 1});
    } else {
      ++same->votes;
    }
  }
  if (candidates.empty()) return fallback;
  const auto most = std::max_element(candidates.begin(), candidates.end(),
                                     [](const Candidate& a, const Candidate& b) { return a.votes < b.votes; });
  most->solution.has_rivals = candidates.size() > 1;
  return most->solution;
}

}  // namespace

Moments::Moments(const PointSet& points) {
  constexpr Eigen::Index kChunk = 1024;
  for (Eigen::Index begin = 0; begin < points.xyz.cols(); begin += kChunk) {
    Matrix chunk = Matrix::Zero();
    const Eigen::Index end = std::min(begin + kChunk, points.xyz.cols());
    for (Eigen::Index i = begin; i < end; ++i) {
      if (!points.takes_part(i)) continue;
      const double x = points.xyz(0, i);
      const double y = points.xyz(1, i);
      const double z = points.xyz(2, i);
      Functional u;
      u << 1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z;
      chunk.noalias() += u * u.transpose();
    }
    mean_ += chunk;
  }
  mean_ /= std::max(mean_(0, 0), 1.0);
}

Eigen::Matrix3d Moments::scatter() const { return mean_.block<3, 3>(1, 1) - centroid() * centroid().transpose(); }

Moments::Functional Moments::constant() { return Functional::Unit(0); }

Moments::Functional Moments::linear(const Eigen::Vector3d& direction) {
  Functional functional = Functional::Zero();
  functional.segment<3>(1) = direction;
  return functional;
}

Moments::Functional Moments::quadratic(const Eigen::Matrix3d& a) {
  Functional functional = Functional::Zero();
  functional.tail<6>() << a(0, 0), 2.0 * a(0, 1), 2.0 * a(0, 2), a(1, 1), 2.0 * a(1, 2), a(2, 2);
  return functional;
}

std::vector<ShapeState> start_states(ShapeKind kind, const PointSet& points, int directions) {
  const Moments moments(points);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments.scatter());
  const Eigen::Matrix3d principal = eigen.eigenvectors();  // least extent first
  if (!(eigen.eigenvalues()(2) > 0.0)) return {};
  std::vector<ShapeState> states;
  const auto across = [](const Eigen::Vector3d& direction) -> Eigen::Matrix<double, 3, 2> {
    return axes_along(direction).leftCols<2>();
  };
  switch (kind) {
    case ShapeKind::kLine:
      states.push_back({moments.centroid(), axes_along(principal.col(2))});
      break;
    case ShapeKind::kPlane:
      states.push_back({moments.centroid(), axes_along(principal.col(0))});
      break;
    case ShapeKind::kCircle:
      states.push_back(round_state(taubin<2>(moments, across(principal.col(0))), axes_along(principal.col(0))));
      break;
    case ShapeKind::kSphere:
      states.push_back(round_state(taubin<3>(moments, Eigen::Matrix3d::Identity()), Eigen::Matrix3d::Identity()));
      break;
    case ShapeKind::kCylinder: {
      const auto misfit = [&](const Eigen::Vector3d& d) { return taubin<2>(moments, across(d)).mean_square; };
      for (const Eigen::Vector3d& d : axis_directions(misfit, directions, principal)) {
        states.push_back(round_state(taubin<2>(moments, across(d)), axes_along(d)));
      }
      break;
    }
    case ShapeKind::kCone: {
      const auto misfit = [&](const Eigen::Vector3d& d) { return revolution(moments, d).mean_square; };
      for (const Eigen::Vector3d& d : axis_directions(misfit, directions, principal)) {
        states.push_back(cone_of(revolution(moments, d), d));
      }
      break;
    }
  }
  return states;
}

std::optional<ShapeSolution> best_solution(const ShapeProblem& problem, const PointSet& points, int directions) {
  const PointSet few = points.thinned(kThinned);
  std::vector<ShapeState> starts = start_states(problem.kind, few, directions);
  if (problem.size) starts = with_size(starts, problem.size->size, few.centroid);
  const bool is_exact = rows_of(problem.kind) * few.xyz.cols() == static_cast<Eigen::Index>(problem.unknowns().size());
  if (is_exact) return most_frequent(problem, few, starts);
  if (starts.size() > kStarts) starts = most_promising(problem, few.thinned(kGlanced), starts);
  std::optional<ShapeSolution> best;
  for (const ShapeState& start : starts) {
    const ShapeSolution solution = solve_shape(problem, few, start, kThinnedSteps);
    if (!solution.converged && best) continue;
    if (!best || solution.square_sum < best->square_sum || (solution.converged && !best->converged)) best = solution;
  }
  return best;
}

}  // namespace crosstie::math::detail
