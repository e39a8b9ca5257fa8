#include "scan/detail/calibration_part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "scan/detail/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kSpacing = 64;  // [px]

std::optional<base::Camera> moved(const base::Camera& camera, Eigen::Index parameter, double step) {
  Eigen::VectorXd parameters = camera.parameters();
  parameters(parameter) += step;
  auto result = base::Camera::make(camera.model(), camera.width_px(), camera.height_px(), std::move(parameters));
  if (!result) return {};
  return *std::move(result);
}

}  // namespace

std::optional<Eigen::Vector3d> point_of_left_ray(const base::Camera& left, const base::Camera& right,
                                                 const base::Pose& right_from_left, const Eigen::Vector2d& left_px,
                                                 const Eigen::Vector2d& right_px) {
  const auto a = left.unproject(left_px);
  const auto ray = right.unproject(right_px);
  if (!a || !ray) return {};
  const base::Pose left_from_right = right_from_left.inverse();
  const Eigen::Vector3d b = left_from_right.rotation * *ray;
  const Eigen::Vector3d& c = left_from_right.translation_mm;
  const double ab = a->dot(b);
  const double along = (a->dot(c) - ab * b.dot(c)) / std::max(1e-12, 1.0 - ab * ab);
  return Eigen::Vector3d(along * *a);
}

std::optional<base::Head> moved_head(const base::Head& head, Eigen::Index parameter, double step) {
  const Eigen::Index left_count = base::parameter_count(head.left.model());
  const Eigen::Index right_count = base::parameter_count(head.right.model());
  base::Head result = head;
  if (parameter < left_count + right_count) {
    base::Camera& camera = parameter < left_count ? result.left : result.right;
    auto changed = moved(camera, parameter < left_count ? parameter : parameter - left_count, step);
    if (!changed) return {};
    camera = *std::move(changed);
    return result;
  }
  base::Vector6d delta = base::Vector6d::Zero();
  delta(parameter - left_count - right_count) = step;
  result.right_from_left = base::perturbed(head.right_from_left, delta);
  return result;
}

Eigen::Matrix3d calibration_covariance(const base::Head& head, const Eigen::Vector3d& point_mm) {
  constexpr double kStep = 0.1;  // of a parameter's sigma
  if (head.cov.size() == 0) return Eigen::Matrix3d::Zero();
  const auto left_px = head.left.project(point_mm);
  const auto right_px = head.right.project(head.right_from_left * point_mm);
  if (!left_px || !right_px) return Eigen::Matrix3d::Zero();
  Eigen::Matrix3Xd jacobian = Eigen::Matrix3Xd::Zero(3, head.cov.cols());
  for (Eigen::Index i = 0; i < head.cov.cols(); ++i) {
    const double step = kStep * std::sqrt(std::max(0.0, head.cov(i, i)));
    if (step == 0.0) continue;
    std::array<std::optional<Eigen::Vector3d>, 2> ends;
    for (std::size_t side = 0; side < 2; ++side) {
      const auto changed = moved_head(head, i, side == 0 ? -step : step);
      if (changed) ends[side] = point_of_left_ray(changed->left, changed->right, changed->right_from_left, *left_px, *right_px);
    }
    if (ends[0] && ends[1]) jacobian.col(i) = (*ends[1] - *ends[0]) / (2.0 * step);
  }
  return jacobian * head.cov * jacobian.transpose();
}

std::vector<float> calibration_sigmas(const base::Head& head, const DepthMap& depths) {
  if (head.cov.size() == 0) return {};
  std::vector<float> known;
  for (std::size_t i = 0; i < depths.depth_mm.size(); i += 97) {
    if (!std::isnan(depths.depth_mm[i])) known.push_back(depths.depth_mm[i]);
  }
  if (known.empty()) return std::vector<float>(depths.depth_mm.size(), 0.0F);
  const double depth = median(known);

  // Sigma over the square of the depth, which changes slowly.
  const int columns = (depths.width + kSpacing - 1) / kSpacing + 1;
  const int rows = (depths.height + kSpacing - 1) / kSpacing + 1;
  Eigen::MatrixXd nodes = Eigen::MatrixXd::Zero(rows, columns);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector2d pixel(std::min(column * kSpacing, depths.width - 1), std::min(row * kSpacing, depths.height - 1));
      const auto ray = head.left.unproject(pixel);
      if (!ray) continue;
      const Eigen::Matrix3d cov = calibration_covariance(head, *ray / ray->z() * depth);
      nodes(row, column) =
          std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(cov).eigenvalues()(2))) / (depth * depth);
    }
  }
  std::vector<float> sigmas(depths.depth_mm.size(), 0.0F);
  for (int y = 0; y < depths.height; ++y) {
    const int row = y / kSpacing;
    const double v = static_cast<double>(y % kSpacing) / kSpacing;
    for (int x = 0; x < depths.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) + static_cast<std::size_t>(x);
      const double z = depths.depth_mm[at];
      if (std::isnan(z)) continue;
      const int column = x / kSpacing;
      const double u = static_cast<double>(x % kSpacing) / kSpacing;
      const double value = (1.0 - v) * ((1.0 - u) * nodes(row, column) + u * nodes(row, column + 1)) +
                           v * ((1.0 - u) * nodes(row + 1, column) + u * nodes(row + 1, column + 1));
      sigmas[at] = static_cast<float>(value * z * z);
    }
  }
  return sigmas;
}

}  // namespace crosstie::scan::detail
