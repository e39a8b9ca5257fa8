#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"
#include "math/circle_of_pair.h"

namespace crosstie::bundle::detail {

/// Reduces the measured ellipse centres to the images of the circles' centres: sets Ray::measured_px of every ray of a known
/// point from Ray::ellipse_px. Nothing need be known of radii and normals:
///
/// A circle of radius r about X in a plane of normal n is M = r^2 (I - n n'). To first order of its size it appears as the
/// ellipse S = J M J' (J = d pixel / d X), which is linear in the six numbers of M; all images of a point give M by least
/// squares, and its nearest matrix of rank two with equal eigenvalues. With M_c in the camera, the dual conic of the image is
/// M_c - X_c X_c' (Hartley & Zisserman, Multiple View Geometry, 2nd ed., ch. 8.2 and 2.2), so the centre of the ellipse is the
/// direction (M_c - X_c X_c') e_z, exactly; its distance from the image of X is the eccentricity.
///
/// Points whose ellipses do not determine a circle (fewer than three images, sizes unknown or contradictory) keep their ellipse
/// centres. The lens's distortion across one dot is not modelled (below 1e-3 px for dots below 50 px). Returns the largest
/// eccentricity that was applied, in px.
double reduce_to_circle_centres(Survey& survey, const State& state);

/// Median diameter of the points' circles, by the same circles; nothing where none is determined.
std::optional<double> dot_diameter_mm(const Survey& survey, const State& state);

using math::CircleView;
using math::eccentricity_px;

/// The circle M = r^2 (I - n n') about `point` that appears as these ellipses; nothing where they determine none.
std::optional<Eigen::Matrix3d> circle_of(std::span<const CircleView> views, const Eigen::Vector3d& point);

/// An ellipse as Ray::shape_px2, in an oriented image.
struct SeenEllipse {
  int image = 0;
  Eigen::Matrix2d shape_px2 = Eigen::Matrix2d::Zero();
};

/// The circle M = r^2 (I - n n') in network about `point` that appears as these ellipses; nothing where they determine none.
std::optional<Eigen::Matrix3d> circle_of(const Survey& survey, const State& state, std::span<const SeenEllipse> ellipses,
                                         const Eigen::Vector3d& point);

}  // namespace crosstie::bundle::detail
