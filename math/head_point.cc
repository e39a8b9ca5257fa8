#include "math/head_point.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

namespace crosstie::math {
namespace {

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

Eigen::VectorXd head_change(const base::Head& from, const base::Head& to) {
  Eigen::VectorXd change(from.parameter_count());
  change << to.left.parameters() - from.left.parameters(), to.right.parameters() - from.right.parameters(),
      base::difference(from.right_from_left, to.right_from_left);
  return change;
}

Eigen::Matrix3Xd point_by_head(const base::Head& head, const Eigen::Vector3d& p_in_rig_mm) {
  constexpr double kStep = 0.1;  // of a parameter's sigma
  Eigen::Matrix3Xd jacobian = Eigen::Matrix3Xd::Zero(3, head.cov.cols());
  const auto left_px = head.left.project(p_in_rig_mm);
  const auto right_px = head.right.project(head.right_from_left * p_in_rig_mm);
  if (!left_px || !right_px) return jacobian;
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
  return jacobian;
}

}  // namespace crosstie::math
