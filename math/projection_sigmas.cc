#include "math/projection_sigmas.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

namespace crosstie::math {
namespace {

using base::Camera;
using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// [w, v] -> w x p + v.
Eigen::Matrix<double, 3, 6> by_motion(const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 3, 6> result;
  result << -base::skew(p), Eigen::Matrix3d::Identity();
  return result;
}

double major_sigma(const Eigen::Matrix2d& covariance) {
  const double mean = 0.5 * covariance.trace();
  const double half = std::hypot(0.5 * (covariance(0, 0) - covariance(1, 1)), covariance(0, 1));
  return std::sqrt(std::max(0.0, mean + half));
}

std::vector<char> calibrated_cells(const Camera& camera, const base::ImageGrid& grid) {
  std::vector<char> result(static_cast<std::size_t>(grid.count()), 0);
  for (int i = 0; i < grid.count(); ++i) result[static_cast<std::size_t>(i)] = camera.calibrated_at(grid.middle_px(i)) ? 1 : 0;
  return result;
}

tl::unexpected<base::Error> wrong_size(const MatrixXd& covariance, Index expected) {
  return fail(ErrorCode::kUsage, fmt::format("a covariance of {} x {} where {} or {} unknowns were expected", covariance.rows(),
                                             covariance.cols(), expected, expected + 6));
}

/// What the parameters do to the projection of a cell's point.
struct Row {
  int cell = 0;
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, 6> by_motion;
  base::ProjectionParameterJacobian by_lens;
};

std::vector<Row> rows_of(const Camera& camera, const base::ImageGrid& grid, double distance_mm) {
  std::vector<Row> rows;
  for (int i = 0; i < grid.count(); ++i) {
    const auto ray = camera.unproject(grid.middle_px(i));
    if (!ray) continue;
    const Eigen::Vector3d p = distance_mm * *ray;
    Row row;
    row.cell = i;
    if (!camera.project(p, &row.by_point, &row.by_lens)) continue;
    row.by_motion = row.by_point * by_motion(p);
    rows.push_back(std::move(row));
  }
  return rows;
}

/// The first `free` components of the motion that follows the parameters, as its derivative by them, over the calibrated cells.
Result<MatrixXd> implied_motion(const std::vector<Row>& rows, const std::vector<char>& calibrated, Index parameters,
                                Index free) {
  MatrixXd normal = MatrixXd::Zero(free, free);
  MatrixXd right = MatrixXd::Zero(free, parameters);
  int count = 0;
  for (const Row& row : rows) {
    if (!calibrated[static_cast<std::size_t>(row.cell)]) continue;
    const auto motion = row.by_motion.leftCols(free);
    normal.noalias() += motion.transpose() * motion;
    right.noalias() -= motion.transpose() * row.by_lens;
    ++count;
  }
  if (count < 4) return fail(ErrorCode::kNoUniqueSolution, "the camera is calibrated in less than four cells of its image");
  return MatrixXd(normal.ldlt().solve(right));
}

}  // namespace

Eigen::Matrix<double, 3, 2> across(const Eigen::Matrix<double, 2, 3>& by_point) {
  return by_point.transpose() * (by_point * by_point.transpose()).inverse();
}

Result<> ProjectionSigmasOptions::validate() const {
  if (!(distance_mm >= 0.0) || !std::isfinite(distance_mm)) return fail(ErrorCode::kUsage, "the distance must be positive");
  if (columns < 4 || columns > 400) return fail(ErrorCode::kUsage, fmt::format("{} columns; 4 to 400 are possible", columns));
  if (!(sigma_px >= 0.0) || !std::isfinite(sigma_px)) return fail(ErrorCode::kUsage, "sigma_px must not be negative");
  return {};
}

Result<base::ProjectionSigmas> projection_sigmas(const Camera& camera, const MatrixXd& covariance,
                                                 const ProjectionSigmasOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  const Index lens = camera.parameters().size();
  const bool to_boards = covariance.rows() == lens + 6;
  if (covariance.rows() != covariance.cols() || (covariance.rows() != lens && !to_boards)) return wrong_size(covariance, lens);
  const bool finite = options.distance_mm > 0.0;
  base::ProjectionSigmas result;
  result.grid = base::ImageGrid::over(camera.width_px(), camera.height_px(), options.columns);
  result.distance_mm = options.distance_mm;
  result.sigma_px = VectorXd::Constant(result.grid.count(), kNone);
  result.minor_px = result.sigma_mm = result.sigma_px;
  result.calibrated = calibrated_cells(camera, result.grid);
  const std::vector<Row> rows = rows_of(camera, result.grid, finite ? options.distance_mm : 1.0);
  // At infinity a translation moves no pixel.
  const Index free = finite ? 6 : 3;
  MatrixXd motion(free, covariance.cols());
  if (to_boards) {
    motion << MatrixXd::Zero(free, lens), MatrixXd::Identity(free, 6);
  } else {
    auto implied = implied_motion(rows, result.calibrated, lens, free);
    if (!implied) return fail(std::move(implied));
    motion = std::move(*implied);
  }
  Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, covariance.cols());
  for (const Row& row : rows) {
    jacobian = row.by_motion.leftCols(free) * motion;
    jacobian.leftCols(lens) += row.by_lens;
    const Eigen::Matrix2d cov = jacobian * covariance * jacobian.transpose();
    result.sigma_px(row.cell) = major_sigma(cov);
    result.minor_px(row.cell) = std::sqrt(std::max(0.0, cov.trace() - std::pow(result.sigma_px(row.cell), 2)));
    if (!finite) continue;
    // Across the ray the object is a plane; of its 3x3 covariance the largest eigenvalue is that of a 2x2 one.
    const Eigen::Matrix<double, 3, 2> back = across(row.by_point);
    const Eigen::Matrix2d root = Eigen::LLT<Eigen::Matrix2d>(back.transpose() * back).matrixU();
    result.sigma_mm(row.cell) = major_sigma(root * cov * root.transpose());
  }
  return result;
}

Result<base::TriangulationSigmas> triangulation_sigmas(const Camera& left, const Camera& right,
                                                       const base::Pose& right_from_left, const MatrixXd& covariance,
                                                       const ProjectionSigmasOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (!(options.distance_mm > 0.0)) return fail(ErrorCode::kUsage, "points at infinity are not triangulated");
  const Index of_left = left.parameters().size();
  const Index of_right = right.parameters().size();
  const Index all = of_left + of_right + 6;
  const bool to_boards = covariance.rows() == all + 6;
  if (covariance.rows() != covariance.cols() || (covariance.rows() != all && !to_boards)) return wrong_size(covariance, all);
  base::TriangulationSigmas result;
  result.grid = base::ImageGrid::over(left.width_px(), left.height_px(), options.columns);
  result.distance_mm = options.distance_mm;
  result.sigma_mm = VectorXd::Constant(result.grid.count(), kNone);
  result.sigma_depth_mm = result.sigma_across_mm = result.sigma_mm;
  result.calibrated.assign(static_cast<std::size_t>(result.grid.count()), 0);
  const Eigen::Matrix3d rotation = right_from_left.rotation.toRotationMatrix();
  for (const Row& row : rows_of(left, result.grid, options.distance_mm)) {
    const Eigen::Vector3d ray = *left.unproject(result.grid.middle_px(row.cell));
    const Eigen::Vector3d p = options.distance_mm * ray;
    const Eigen::Vector3d p_in_right = right_from_left * p;
    Eigen::Matrix<double, 2, 3> right_by_point;
    base::ProjectionParameterJacobian right_by_lens;
    const auto pixel = right.project(p_in_right, &right_by_point, &right_by_lens);
    if (!pixel || pixel->minCoeff() < -0.5 || pixel->x() > right.width_px() - 0.5 || pixel->y() > right.height_px() - 0.5)
      continue;
    const bool calibrated = left.calibrated_at(result.grid.middle_px(row.cell)) && right.calibrated_at(*pixel);
    result.calibrated[static_cast<std::size_t>(row.cell)] = calibrated ? 1 : 0;
    // The four image coordinates stand still while the unknowns move.
    Eigen::Matrix<double, 4, 3> by_point;
    by_point << row.by_point, right_by_point * rotation;
    MatrixXd by_unknowns = MatrixXd::Zero(4, covariance.cols());
    by_unknowns.topLeftCorner(2, of_left) = row.by_lens;
    by_unknowns.block(2, of_left, 2, of_right) = right_by_lens;
    by_unknowns.block<2, 6>(2, of_left + of_right) = right_by_point * by_motion(p_in_right);
    const Eigen::Matrix<double, 3, 4> solve = (by_point.transpose() * by_point).ldlt().solve(by_point.transpose());
    MatrixXd moved = -solve * by_unknowns;
    if (to_boards) moved.rightCols<6>() -= by_motion(p);
    const Eigen::Matrix3d cov =
        moved * covariance * moved.transpose() + options.sigma_px * options.sigma_px * solve * solve.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(cov, Eigen::EigenvaluesOnly);
    result.sigma_mm(row.cell) = std::sqrt(std::max(0.0, axes.eigenvalues()(2)));
    result.sigma_depth_mm(row.cell) = std::sqrt(std::max(0.0, ray.dot(cov * ray)));
    Eigen::Matrix<double, 3, 2> plane;
    plane.col(0) = ray.unitOrthogonal();
    plane.col(1) = ray.cross(plane.col(0));
    result.sigma_across_mm(row.cell) = major_sigma(plane.transpose() * cov * plane);
  }
  return result;
}

}  // namespace crosstie::math
