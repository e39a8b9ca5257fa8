#include "bundle/detail/rig_check.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "bundle/detail/eccentricity.h"
#include "math/circle_of_pair.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// One row of Epipolar, with its derivatives by lenses and rig.
struct Row {
  double residual_px = 0.0;
  Eigen::RowVectorXd by_known;
  Eigen::Matrix<double, 1, 6> by_rig;
  double image_variance = 0.0;
};

/// The left ray at a depth, seen by the right camera.
struct Seen {
  Vector2d px;
  Vector2d along;  ///< derivative by the depth
  Eigen::Matrix<double, 2, 3> by_point;
  base::ProjectionParameterJacobian by_lens;
};

std::optional<Seen> seen_at(const base::Head& head, const Vector3d& ray, double depth_mm) {
  Seen seen;
  const auto px = head.right.project(head.right_from_left * Vector3d(depth_mm * ray), &seen.by_point, &seen.by_lens);
  if (!px) return std::nullopt;
  seen.px = *px;
  seen.along = seen.by_point * (head.right_from_left.rotation * ray);
  return seen;
}

/// Depth at which both rays come nearest; nothing where they are parallel or meet behind.
std::optional<double> depth_of(const base::Head& head, const Vector3d& left, const Vector3d& right) {
  const Vector3d a = head.right_from_left.rotation * left;
  const Vector3d& t = head.right_from_left.translation_mm;
  const Vector3d across = a.cross(right);
  if (!(across.squaredNorm() > 1e-12 * a.squaredNorm() * right.squaredNorm())) return std::nullopt;
  const double depth_mm = -t.cross(right).dot(across) / across.squaredNorm();
  return depth_mm > 0.0 ? std::optional(depth_mm) : std::nullopt;
}

std::optional<Row> row_of(const base::Head& head, const CommonMarker& marker) {
  constexpr int kSteps = 4;
  const auto left = head.left.unproject(marker.left_px);
  const auto right = head.right.unproject(marker.right_px);
  if (!left || !right) return std::nullopt;
  const Vector3d ray = *left / left->z();
  auto depth_mm = depth_of(head, ray, *right);
  if (!depth_mm) return std::nullopt;
  auto seen = seen_at(head, ray, *depth_mm);
  // To the point of the curve that is nearest to the image point.
  for (int step = 0; step < kSteps && seen; ++step) {
    *depth_mm += seen->along.dot(marker.right_px - seen->px) / seen->along.squaredNorm();
    seen = seen_at(head, ray, *depth_mm);
  }
  if (!seen || !(*depth_mm > 0.0)) return std::nullopt;
  const Vector2d normal = Vector2d(-seen->along.y(), seen->along.x()).normalized();
  Eigen::Matrix<double, 2, 3> left_by_point;
  base::ProjectionParameterJacobian left_by_lens;
  if (!head.left.project(ray, &left_by_point, &left_by_lens)) return std::nullopt;
  const Eigen::RowVector3d by_point = normal.transpose() * seen->by_point;
  // The ray turns as the left image point moves, or as the left lens changes beneath it.
  const Eigen::RowVector2d by_ray = (*depth_mm * by_point * head.right_from_left.rotation.toRotationMatrix()).head<2>();
  const Eigen::RowVector2d by_left_px = by_ray * left_by_point.leftCols<2>().inverse();
  const Vector3d p_in_right = head.right_from_left * Vector3d(*depth_mm * ray);
  Row row;
  row.residual_px = normal.dot(marker.right_px - seen->px);
  row.by_rig << -by_point * base::skew(p_in_right), by_point;
  row.by_known.resize(left_by_lens.cols() + seen->by_lens.cols() + 6);
  row.by_known << -by_left_px * left_by_lens, normal.transpose() * seen->by_lens, row.by_rig;
  row.image_variance = normal.dot(marker.right_cov * normal) + (by_left_px * marker.left_cov * by_left_px.transpose()).value();
  return row;
}

/// A change by which the singular values of what is seen are counted.
base::Vector6d typical_change() {
  base::Vector6d change;
  change << kUnseen_rad, kUnseen_rad, kUnseen_rad, kUnseen_mm, kUnseen_mm, kUnseen_mm;
  return change;
}

}  // namespace

void reduce_to_circle_centres(const base::Head& head, CommonMarker& marker) {
  if (!(marker.left_shape_px2.trace() > 0.0) || !(marker.right_shape_px2.trace() > 0.0)) return;
  const auto left = head.left.unproject(marker.left_px);
  const auto right = head.right.unproject(marker.right_px);
  if (!left || !right) return;
  const Vector3d ray = *left / left->z();
  const auto depth_mm = depth_of(head, ray, *right);
  if (!depth_mm) return;
  const Vector3d p_in_rig = *depth_mm * ray;
  const std::array<CircleView, 2> views = {
      CircleView{head.left.model(), head.left.parameters().data(), base::Pose{}, marker.left_shape_px2},
      CircleView{head.right.model(), head.right.parameters().data(), head.right_from_left, marker.right_shape_px2}};
  const auto circle = math::circle_of_pair(views, p_in_rig);
  if (!circle) return;
  const auto of_left = eccentricity_px(views[0], p_in_rig, *circle);
  const auto of_right = eccentricity_px(views[1], p_in_rig, *circle);
  if (!of_left || !of_right) return;
  marker.left_px -= *of_left;
  marker.right_px -= *of_right;
}

Epipolar epipolar_of(const base::Head& head, const MatrixXd& head_cov, const std::vector<CommonMarker>& markers) {
  std::vector<Row> rows;
  Epipolar all;
  for (const CommonMarker& marker : markers) {
    auto row = row_of(head, marker);
    if (!row) continue;
    rows.push_back(*std::move(row));
    all.ids.push_back(marker.id);
  }
  const auto count = static_cast<Index>(rows.size());
  MatrixXd by_known(count, head_cov.rows());
  all.residual_px.resize(count);
  all.by_rig.resize(count, 6);
  VectorXd image(count);
  for (Index i = 0; i < count; ++i) {
    const Row& row = rows[static_cast<std::size_t>(i)];
    all.residual_px(i) = row.residual_px;
    all.by_rig.row(i) = row.by_rig;
    by_known.row(i) = row.by_known;
    image(i) = row.image_variance;
  }
  all.cov = by_known * head_cov * by_known.transpose();
  all.cov.diagonal() += image;
  return all;
}

RigCheck check_rig(const base::Head& head, const MatrixXd& head_cov, std::vector<CommonMarker> markers, double ray_level) {
  RigCheck check;
  for (;;) {
    const Epipolar at = epipolar_of(head, head_cov, markers);
    const auto count = at.residual_px.size();
    check.rms_px = count > 0 ? std::sqrt(at.residual_px.squaredNorm() / static_cast<double>(count)) : 0.0;
    if (at.ids.size() < kLeastCommon) return check;
    const Eigen::LLT<MatrixXd> root(at.cov);
    const VectorXd e = root.matrixL().solve(at.residual_px);
    const base::Vector6d typical = typical_change();
    const MatrixXd a = root.matrixL().solve(at.by_rig);
    const Eigen::JacobiSVD<MatrixXd> svd(a * typical.asDiagonal(), Eigen::ComputeThinU | Eigen::ComputeThinV);
    Index rank = 0;
    while (rank < 6 && svd.singularValues()(rank) >= 1.0) ++rank;
    const MatrixXd u = svd.matrixU().leftCols(rank);
    const VectorXd part = u.transpose() * e;

    // A wrong id is not a moved rig: what is left beside every change must be noise.
    const VectorXd left = at.residual_px - MatrixXd(root.matrixL()) * (u * part);
    const MatrixXd lu = MatrixXd(root.matrixL()) * u;
    double worst = 0.0;
    Index culprit = 0;
    for (Index i = 0; i < count; ++i) {
      const double variance = at.cov(i, i) - lu.row(i).squaredNorm();
      if (variance <= 1e-6 * at.cov(i, i)) continue;
      const double w = std::abs(left(i)) / std::sqrt(variance);
      if (w <= worst) continue;
      worst = w;
      culprit = i;
    }
    if (std::erfc(worst / std::sqrt(2.0)) < ray_level) {
      const int id = at.ids[static_cast<std::size_t>(culprit)];
      check.rejected.push_back(
          {"both images", id,
           fmt::format("blunder: its distance from the epipolar curve is {:.1f} times what the sigmas allow", worst), worst});
      std::erase_if(markers, [&](const CommonMarker& marker) { return marker.id == id; });
      continue;
    }
    check.dof = static_cast<int>(rank);
    check.statistic = part.squaredNorm();
    for (Index i = 0; i < 6; ++i) {
      const double norm = a.col(i).norm();
      check.alone[static_cast<std::size_t>(i)] = norm * typical(i) >= 1.0 ? a.col(i).dot(e) / norm : 0.0;
    }
    const VectorXd values = svd.singularValues();
    const MatrixXd& v = svd.matrixV();
    check.change = typical.asDiagonal() * (v.leftCols(rank) * part.cwiseQuotient(values.head(rank)));
    // Of all directions: those that are not determined make the sigma as large as they are.
    const VectorXd spread = values.cwiseMax(1e-6).cwiseInverse();
    check.sigma = typical.cwiseProduct((v * spread.asDiagonal()).rowwise().norm());
    for (Index i = 0; i < 6; ++i) check.seen[static_cast<std::size_t>(i)] = check.sigma(i) < typical(i);
    return check;
  }
}

}  // namespace crosstie::bundle::detail
