#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "bundle/detail/eccentricity.h"

namespace crosstie::bundle::detail {

/// The circle M = r^2 (I - n n') about a known point that appears as these ellipses, from one or two images, which do not determine the six
/// numbers of M by themselves (circle_of() needs three): its normal is searched for among those that face the first camera, its radius
/// follows linearly. One image is shown alike by two normals; then one of them is returned. Nothing where no circle explains the ellipses to
/// 15 %, as in circle_of().
std::optional<Eigen::Matrix3d> circle_of_pair(std::span<const CircleView> views, const Eigen::Vector3d& point);

}  // namespace crosstie::bundle::detail
