#include "math/projection_difference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>

#include "math/chi_square_sum.h"
#include "math/projection_sigmas.h"

namespace crosstie::math {
namespace {

using base::Camera;
using base::ErrorCode;
using base::fail;
using base::Pose;
using base::ProjectionDifference;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kLeastCells = 10;
constexpr double kUnit = 1.0;  // [mm] of directions

struct Cell {
  int index = 0;
  Eigen::Vector2d pixel;
  Eigen::Vector3d p_in_a;
  bool compared = false;
};

/// Points of the grid in the frame of `a`; those that it does not know are missing.
std::vector<Cell> cells_of(const Camera& a, const Camera& b, const base::ImageGrid& grid,
                           const ProjectionDifferenceOptions& options) {
  const double distance = options.distance_mm > 0.0 ? options.distance_mm : kUnit;
  const Eigen::Vector2d middle = 0.5 * Eigen::Vector2d(grid.width_px - 1, grid.height_px - 1);
  std::vector<Cell> cells;
  for (int i = 0; i < grid.count(); ++i) {
    const Eigen::Vector2d pixel = grid.middle_px(i);
    const auto ray = a.unproject(pixel);
    if (!ray) continue;
    const bool near = !(options.radius_px > 0.0) || (pixel - middle).norm() <= options.radius_px;
    cells.push_back({i, pixel, distance * *ray, near && a.calibrated_at(pixel) && b.calibrated_at(pixel)});
  }
  return cells;
}

/// The difference at a cell and its derivative by the perturbation of b_from_a.
struct At {
  Eigen::Vector2d difference;
  Eigen::Matrix<double, 2, 6> by_motion;
  Eigen::Matrix<double, 2, 3> by_point;  // of p in b's frame
};

std::optional<At> at(const Camera& b, const Pose& b_from_a, const Cell& cell,
                     base::ProjectionParameterJacobian* by_lens = nullptr) {
  const Eigen::Vector3d p_in_b = b_from_a * cell.p_in_a;
  At result;
  const auto pixel = b.project(p_in_b, &result.by_point, by_lens);
  if (!pixel) return {};
  result.difference = *pixel - cell.pixel;
  result.by_motion << -result.by_point * base::skew(p_in_b), result.by_point;
  return result;
}

/// Of all cells; not a number where b has no answer.
Eigen::Matrix2Xd differences(const Camera& b, const Pose& b_from_a, const std::vector<Cell>& cells,
                             const base::ImageGrid& grid) {
  Eigen::Matrix2Xd result = Eigen::Matrix2Xd::Constant(2, grid.count(), std::numeric_limits<double>::quiet_NaN());
  for (const Cell& cell : cells) {
    if (const auto pixel = b.project(b_from_a * cell.p_in_a)) result.col(cell.index) = *pixel - cell.pixel;
  }
  return result;
}

struct Normal {
  base::Matrix6d matrix = base::Matrix6d::Zero();
  base::Vector6d gradient = base::Vector6d::Zero();
  double square_sum = 0.0;
  int count = 0;
};

Normal normal_of(const Camera& b, const Pose& b_from_a, const std::vector<Cell>& cells) {
  Normal normal;
  for (const Cell& cell : cells) {
    if (!cell.compared) continue;
    const auto here = at(b, b_from_a, cell);
    if (!here) continue;
    normal.matrix.noalias() += here->by_motion.transpose() * here->by_motion;
    normal.gradient.noalias() += here->by_motion.transpose() * here->difference;
    normal.square_sum += here->difference.squaredNorm();
    ++normal.count;
  }
  return normal;
}

/// Gauss-Newton with damping over the first `free` components of the motion.
Pose fit(const Camera& b, const std::vector<Cell>& cells, Index free) {
  Pose pose;
  Normal here = normal_of(b, pose, cells);
  double damping = 1e-6;
  for (int i = 0; i < 100 && damping < 1e8; ++i) {
    MatrixXd matrix = here.matrix.topLeftCorner(free, free);
    matrix.diagonal() *= 1.0 + damping;
    base::Vector6d step = base::Vector6d::Zero();
    step.head(free) = -matrix.ldlt().solve(here.gradient.head(free));
    if (!step.allFinite()) break;
    const Pose trial = base::perturbed(pose, step);
    const Normal next = normal_of(b, trial, cells);
    // A cell that leaves the model's domain must not look like a gain.
    if (next.count < here.count || next.square_sum > here.square_sum) {
      damping *= 10.0;
      continue;
    }
    const bool done = here.square_sum - next.square_sum <= 1e-14 * here.square_sum;
    pose = trial;
    here = next;
    damping = std::max(1e-12, 0.1 * damping);
    if (done) break;
  }
  return pose;
}

/// Probability that the sum of squares of the compared cells' differences is at least what it is. It is that of sum l_i z_i^2 with
/// standard normal z_i, l_i the eigenvalues of `normal` (sum of J'J over these cells) times the covariance of both models' parameters.
base::DifferenceTest test_of(const MatrixXd& normal, const MatrixXd& covariance_a, const MatrixXd& covariance_b, int cells,
                             double rms_px, double level) {
  MatrixXd product(normal.rows(), normal.cols());
  product.leftCols(covariance_a.cols()) = normal.leftCols(covariance_a.cols()) * covariance_a;
  product.rightCols(covariance_b.cols()) = normal.rightCols(covariance_b.cols()) * covariance_b;
  const MatrixXd square = product * product;
  const std::array<double, 3> moments = {product.trace(), square.trace(), square.cwiseProduct(product.transpose()).sum()};
  base::DifferenceTest test;
  test.rms_sigma_px = std::sqrt(std::max(0.0, moments[0]) / cells);
  test.degrees = moments[0] * moments[0] / moments[1];
  test.p = chi_square_sum_above(rms_px * rms_px * cells, moments);
  test.level = level;
  test.limit_px = std::sqrt(chi_square_sum_limit(level, moments) / cells);
  return test;
}

/// Sigmas of all differences, after the motion that they imply, by both models' parameters; and the test.
void add_sigmas(const Camera& a, const Camera& b, const std::vector<Cell>& cells, Index free, double level,
                ProjectionDifference& result) {
  const Index size_a = a.parameters().size();
  const Index size_b = b.parameters().size();
  MatrixXd rows = MatrixXd::Zero(2 * static_cast<Index>(cells.size()), size_a + size_b);
  MatrixXd motion = MatrixXd::Zero(rows.rows(), free);
  MatrixXd decisive = MatrixXd::Zero(rows.rows(), free);
  std::vector<char> known(cells.size(), 0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Index row = 2 * static_cast<Index>(i);
    Eigen::Matrix<double, 2, 3> a_by_point;
    base::ProjectionParameterJacobian a_by_lens;
    base::ProjectionParameterJacobian b_by_lens;
    const auto here = at(b, result.b_from_a, cells[i], &b_by_lens);
    if (!here || !a.project(cells[i].p_in_a, &a_by_point, &a_by_lens)) continue;
    known[i] = 1;
    // The ray that a sees at its pixel moves so that the pixel stays.
    const Eigen::Matrix<double, 3, 2> a_by_pixel = across(a_by_point);
    rows.block(row, 0, 2, size_a) = -(here->by_point * result.b_from_a.rotation.toRotationMatrix() * a_by_pixel) * a_by_lens;
    rows.block(row, size_a, 2, size_b) = b_by_lens;
    motion.middleRows<2>(row) = here->by_motion.leftCols(free);
    if (cells[i].compared) decisive.middleRows<2>(row) = motion.middleRows<2>(row);
  }
  const Eigen::LDLT<MatrixXd> normal(decisive.transpose() * decisive);
  rows -= motion * normal.solve(decisive.transpose() * rows);
  const VectorXd variance = (rows.leftCols(size_a) * a.covariance()).cwiseProduct(rows.leftCols(size_a)).rowwise().sum() +
                            (rows.rightCols(size_b) * b.covariance()).cwiseProduct(rows.rightCols(size_b)).rowwise().sum();
  result.sigma_px = VectorXd::Constant(result.grid.count(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Index row = 2 * static_cast<Index>(i);
    if (known[i]) result.sigma_px(cells[i].index) = std::sqrt(std::max(0.0, variance.segment<2>(row).sum()));
    if (!result.compared[static_cast<std::size_t>(cells[i].index)]) rows.middleRows<2>(row).setZero();
  }
  const auto test = test_of(rows.transpose() * rows, a.covariance(), b.covariance(), result.cells, result.rms_px, level);
  if (test.rms_sigma_px > 0.0) result.test = test;
}

}  // namespace

Result<> ProjectionDifferenceOptions::validate() const {
  if (!(distance_mm >= 0.0) || !std::isfinite(distance_mm)) return fail(ErrorCode::kUsage, "the distance must be positive");
  if (columns < 4 || columns > 400) return fail(ErrorCode::kUsage, fmt::format("{} columns; 4 to 400 are possible", columns));
  if (!(radius_px >= 0.0)) return fail(ErrorCode::kUsage, "the radius must be positive");
  if (!(significance > 0.0 && significance < 0.5)) return fail(ErrorCode::kUsage, "the level lies between 0 and 0.5");
  return {};
}

Result<ProjectionDifference> projection_difference(const Camera& a, const Camera& b,
                                                   const ProjectionDifferenceOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (a.width_px() != b.width_px() || a.height_px() != b.height_px()) {
    return fail(ErrorCode::kBadInput, fmt::format("images of {} x {} px and of {} x {} px are not one camera's", a.width_px(),
                                                  a.height_px(), b.width_px(), b.height_px()));
  }
  ProjectionDifference result;
  result.grid = base::ImageGrid::over(a.width_px(), a.height_px(), options.columns);
  result.distance_mm = options.distance_mm;
  const std::vector<Cell> cells = cells_of(a, b, result.grid, options);
  const Normal before = normal_of(b, {}, cells);
  if (before.count < kLeastCells) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("the models have {} of {} cells in common in which both are calibrated; {} are needed",
                            before.count, result.grid.count(), kLeastCells));
  }
  result.rms_before_px = std::sqrt(before.square_sum / before.count);
  result.before_px = differences(b, {}, cells, result.grid);
  const Index free = options.distance_mm > 0.0 ? 6 : 3;
  result.b_from_a = fit(b, cells, free);
  result.difference_px = differences(b, result.b_from_a, cells, result.grid);
  result.compared.assign(static_cast<std::size_t>(result.grid.count()), 0);
  double sum = 0.0;
  for (const Cell& cell : cells) {
    const Eigen::Vector2d difference = result.difference_px.col(cell.index);
    if (!cell.compared || !difference.allFinite()) continue;
    result.compared[static_cast<std::size_t>(cell.index)] = 1;
    ++result.cells;
    sum += difference.squaredNorm();
    result.max_px = std::max(result.max_px, difference.norm());
    const Eigen::Vector2d without = result.before_px.col(cell.index);
    if (without.allFinite()) result.max_before_px = std::max(result.max_before_px, without.norm());
  }
  if (result.cells < kLeastCells)
    return fail(ErrorCode::kNoUniqueSolution, "no motion of the camera brings the models together");
  result.rms_px = std::sqrt(sum / result.cells);
  if (a.covariance().size() > 0 && b.covariance().size() > 0) {
    add_sigmas(a, b, cells, free, options.significance, result);
  }
  return result;
}

}  // namespace crosstie::math
