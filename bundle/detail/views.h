#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"
#include "bundle/detail/weights.h"

namespace crosstie::bundle::detail {

/// An oriented image, ready to predict where points appear.
struct View {
  base::Camera camera;
  base::Pose camera_from_network;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of projection, in network
  /// By how much the uncertainty of pose and lens moves a prediction: the largest sigma over the image's coded points [px].
  double orientation_sigma_px = 0.0;
};

/// Where a point appears, and how that changes with the point (in network).
struct Sight {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
};

/// Of each image of the survey; nothing where it is not oriented.
std::vector<std::optional<View>> make_views(const Survey& survey, const State& state, const Estimate& at,
                                            const Weights& weights);

/// Nothing where the point is behind the camera, outside of the lens's valid domain or outside of the image.
std::optional<Sight> see(const View& view, const Eigen::Vector3d& point);

/// The angle at which the lines from two projection centres meet at a point [rad].
double angle_at(const Eigen::Vector3d& point, const View& a, const View& b);

/// For each image the images in which matches of its dots are looked for first, best first: many common points that are seen at
/// an angle which gives depth and still shows the same side.
std::vector<std::vector<int>> partner_images(const Survey& survey, const State& state,
                                             const std::vector<std::optional<View>>& views);

}  // namespace crosstie::bundle::detail
