#include "math/detail/shape_solver.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace crosstie::math::detail {
namespace {

using base::ErrorCode;
using base::Result;

constexpr int kMaxPolish = 100;
constexpr double kDampedStep = 1e-8;        // where Gauss-Newton takes over; the points' spread is near 1
constexpr double kStalledStep = 1e-6;       // steps that stop to shrink below this are rounding of a weak shape
constexpr double kLeastEigenvalue = 1e-14;  // of the normal matrix scaled to unit diagonal: below, rounding decides
constexpr double kFarAway = 1e7;            // a shape that large runs away

ShapeNormals normals_with_knowledge(const ShapeProblem& problem, const PointSet& points, const ShapeState& state) {
  ShapeNormals normals = shape_normals(problem.kind, state, points);
  if (problem.size && !problem.holds_size()) {
    const double weight = 1.0 / (problem.size->sigma * problem.size->sigma);
    const double residual = problem.size->size - state.size;
    normals.matrix(kSize, kSize) += weight;
    normals.right(kSize) += weight * residual;
    normals.square_sum += weight * residual * residual;
  }
  return normals;
}

/// The step with the diagonal raised by the factor 1 + damping; nothing where the matrix is not positive.
std::optional<Vector7d> step_of(const ShapeNormals& normals, const std::vector<int>& unknowns, double damping) {
  const Eigen::MatrixXd matrix = normals.matrix(unknowns, unknowns);
  const Eigen::VectorXd diagonal = matrix.diagonal();
  if (!(diagonal.minCoeff() > 0.0) || !diagonal.allFinite()) return std::nullopt;
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  scaled.diagonal().array() += damping;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(scaled);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0)) return std::nullopt;
  const Eigen::VectorXd right = scale.cwiseProduct(Eigen::VectorXd(normals.right(unknowns)));
  const Eigen::VectorXd step = scale.cwiseProduct(Eigen::VectorXd(ldlt.solve(right)));
  Vector7d full = Vector7d::Zero();
  for (std::size_t i = 0; i < unknowns.size(); ++i) full(unknowns[i]) = step(static_cast<Eigen::Index>(i));
  return full;
}

bool is_near(const ShapeState& state) {
  return state.origin.allFinite() && state.origin.norm() < kFarAway && std::abs(state.size) < kFarAway;
}

bool is_sensible(ShapeKind kind, const ShapeState& state) {
  const bool has_radius = kind == ShapeKind::kCircle || kind == ShapeKind::kSphere || kind == ShapeKind::kCylinder;
  return is_near(state) && (!has_radius || state.size > 0.0);
}

/// False where it stops short of kDampedStep.
bool descend(const ShapeProblem& problem, const PointSet& points, int steps, ShapeSolution& at) {
  const std::vector<int> unknowns = problem.unknowns();
  ShapeNormals normals = normals_with_knowledge(problem, points, at.state);
  const double rounding = 1e-30 * static_cast<double>(points.count()) / (points.sigma * points.sigma);
  double damping = 0.0;
  for (int i = 0; i < steps; ++i) {
    at.square_sum = normals.square_sum;
    const auto step = step_of(normals, unknowns, damping);
    if (step) {
      const ShapeState next = changed(problem.kind, at.state, *step, points.centroid);
      const bool small = step->norm() < kDampedStep * (1.0 + std::abs(at.state.size));
      if (is_sensible(problem.kind, next)) {
        ShapeNormals there = normals_with_knowledge(problem, points, next);
        ++at.iterations;
        if (there.weights_are_good && there.square_sum <= normals.square_sum * (1.0 + 1e-9) + rounding) {
          at.state = next;
          normals = std::move(there);
          damping = damping < 1e-7 ? 0.0 : damping * 0.1;
          at.square_sum = normals.square_sum;
          if (small && damping < 1e-3) return true;
          continue;
        }
      }
    }
    damping = std::max(1e-4, damping * 10.0);
    if (damping > 1e12) return false;
  }
  return false;
}

/// Undamped steps until they no longer shrink.
bool polish(const ShapeProblem& problem, const PointSet& points, ShapeSolution& at) {
  const std::vector<int> unknowns = problem.unknowns();
  double last = 1e300;
  int stalled = 0;
  for (int i = 0; i < kMaxPolish; ++i) {
    const ShapeNormals normals = normals_with_knowledge(problem, points, at.state);
    at.square_sum = normals.square_sum;
    ++at.iterations;
    const auto step = step_of(normals, unknowns, 0.0);
    if (!step) return false;
    const double size = step->norm() / (1.0 + std::abs(at.state.size));
    const ShapeState next = changed(problem.kind, at.state, *step, points.centroid);
    if (!is_sensible(problem.kind, next)) return false;
    at.state = next;
    if (size > 0.9 * last && size < kStalledStep) ++stalled;
    if (size < 1e-15 || stalled == 3) return true;
    last = size;
  }
  return last < kStalledStep;
}

const char* weak_parameter(int parameter) {
  switch (parameter) {
    case kU:
    case kV:
      return "the place across the axis";
    case kW:
      return "the place along the axis";
    case kA:
    case kB:
      return "the direction";
    case kSize:
      return "the size";
    default:
      return "the cone angle";
  }
}

}  // namespace

std::vector<int> ShapeProblem::unknowns() const {
  std::vector<int> all = parameters_of(kind);
  if (holds_size()) std::erase(all, static_cast<int>(kSize));
  return all;
}

ShapeSolution solve_shape(const ShapeProblem& problem, const PointSet& points, const ShapeState& start, int damped_steps) {
  ShapeSolution solution;
  solution.state = changed(problem.kind, start, Vector7d::Zero(), points.centroid);
  if (problem.holds_size()) solution.state.size = problem.size->size;
  solution.converged = descend(problem, points, damped_steps, solution);
  return solution;
}

void solve_to_rounding(const ShapeProblem& problem, const PointSet& points, ShapeSolution& solution) {
  solution.converged = polish(problem, points, solution);
}

Result<Matrix7d> shape_cofactors(const ShapeProblem& problem, const PointSet& points, const ShapeState& state) {
  const std::vector<int> unknowns = problem.unknowns();
  const Eigen::MatrixXd matrix = normals_with_knowledge(problem, points, state).matrix(unknowns, unknowns);
  const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (!(eigen.eigenvalues()(0) > kLeastEigenvalue)) {
    Eigen::Index weakest = 0;
    eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&weakest);
    return base::fail(ErrorCode::kNoUniqueSolution,
                      "the points leave " + std::string(weak_parameter(unknowns[static_cast<std::size_t>(weakest)])) +
                          " of the " + name_of(problem.kind) + " free");
  }
  const Eigen::MatrixXd inverse =
      scale.asDiagonal() *
      (eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose()) *
      scale.asDiagonal();
  Matrix7d full = Matrix7d::Zero();
  full(unknowns, unknowns) = inverse;
  return full;
}

}  // namespace crosstie::math::detail
