#include "scan/detail/calibration_part.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "math/head_point.h"
#include "math/median.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kSpacing = 64;  // [px]

}  // namespace

Eigen::Matrix3d calibration_covariance(const base::Head& head, const Eigen::Vector3d& point_mm) {
  if (head.cov.size() == 0) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3Xd jacobian = math::point_by_head(head, point_mm);
  return jacobian * head.cov * jacobian.transpose();
}

std::vector<float> calibration_sigmas(const base::Head& head, const DepthMap& depths, int threads) {
  if (head.cov.size() == 0) return {};
  std::vector<float> known;
  for (std::size_t i = 0; i < depths.depth_mm.size(); i += 97) {
    if (!std::isnan(depths.depth_mm[i])) known.push_back(depths.depth_mm[i]);
  }
  if (known.empty()) return std::vector<float>(depths.depth_mm.size(), 0.0F);
  const double depth = math::median(known);

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
  const auto fill_row = [&](int y) {
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
  };
  over_rows(depths.height, threads, [&](int first, int last) {
    for (int y = first; y < last; ++y) fill_row(y);
  });
  return sigmas;
}

}  // namespace crosstie::scan::detail
