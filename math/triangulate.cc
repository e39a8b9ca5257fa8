#include "math/triangulate.h"

#include <Eigen/Cholesky>

namespace crosstie::math {

std::optional<Triangulated> triangulate(const base::Head& head, const HeadSight& sight, const Eigen::Vector3d& start) {
  constexpr int kMost = 10;
  constexpr double kStill_mm = 1e-9;
  const Eigen::Matrix3d rotation = head.right_from_left.rotation.toRotationMatrix();
  Triangulated result;
  result.p_in_rig_mm = start;
  for (int step = 0; step < kMost; ++step) {
    Eigen::Matrix<double, 2, 3> by_left, by_right;
    const auto left = head.left.project(result.p_in_rig_mm, &by_left);
    const auto right = head.right.project(head.right_from_left * result.p_in_rig_mm, &by_right);
    if (!left || !right) return {};
    by_right = by_right * rotation;
    const Eigen::Matrix3d normal =
        by_left.transpose() * sight.weight[0] * by_left + by_right.transpose() * sight.weight[1] * by_right;
    const Eigen::Vector3d pull = by_left.transpose() * sight.weight[0] * (sight.pixel[0] - *left) +
                                 by_right.transpose() * sight.weight[1] * (sight.pixel[1] - *right);
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal);
    if (!(ldlt.vectorD().minCoeff() > 0.0)) return {};
    const Eigen::Vector3d move = ldlt.solve(pull);
    result.p_in_rig_mm += move;
    result.cov_mm2 = ldlt.solve(Eigen::Matrix3d::Identity());
    if (!result.p_in_rig_mm.allFinite()) return {};
    if (move.norm() < kStill_mm * result.p_in_rig_mm.norm()) return result;
  }
  return result;
}

}  // namespace crosstie::math
