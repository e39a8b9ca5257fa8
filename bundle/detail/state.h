#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "bundle/detail/survey.h"

namespace crosstie::bundle::detail {

/// What is known of a network at some moment.
struct State {
  std::vector<Eigen::VectorXd> lenses;                 ///< parameters of each camera
  std::vector<std::optional<base::Pose>> poses;        ///< network_from_camera of each image that is oriented
  std::vector<std::optional<base::Pose>> mounts;       ///< rig_from_camera of each camera on a rig, where known
  std::vector<std::optional<Eigen::Vector3d>> points;  ///< in network, of each point that is known
  int iterations = 0;                                  ///< that it took to get here from the start values
  std::vector<char> active;                            ///< of each ray: whether it takes part

  [[nodiscard]] bool knows(const Ray& ray) const {
    return poses[static_cast<std::size_t>(ray.image)].has_value() && points[static_cast<std::size_t>(ray.point)].has_value();
  }
};

/// The lens parameters of the survey's cameras, no pose, no point, every ray active whose id is read once in its image.
State start_state(const Survey& survey);

/// Where a point (in network) appears in an oriented image; nothing behind the camera.
std::optional<Eigen::Vector2d> project_into(const Survey& survey, const State& state, int image, const Eigen::Vector3d& point);
/// Where a ray's marker should appear; nothing behind the camera. The ray's image and point must be known.
std::optional<Eigen::Vector2d> predicted_px(const Survey& survey, const State& state, const Ray& ray);
/// Distance between measured and predicted; infinite where there is no prediction.
double distance_px(const Survey& survey, const State& state, const Ray& ray);

/// Robust sigma of an image coordinate [px]: 1.4826 times the median of the absolute residuals of the active rays.
double robust_sigma_px(const Survey& survey, const State& state);

/// Multiplies the network by `scale` about the origin.
void rescale(State& state, double scale);
/// Moves poses and points into another frame.
void transform(State& state, const base::Pose& other_from_network);

}  // namespace crosstie::bundle::detail
