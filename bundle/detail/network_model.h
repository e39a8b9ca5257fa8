#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"
#include "math/image_point.h"
#include "math/model.h"

namespace crosstie::bundle::detail {

/// What takes part in a model and how.
struct ModelPlan {
  std::vector<std::vector<int>> free_lens;  ///< of each camera: the parameters that are estimated
  std::vector<Eigen::Matrix2d> whitening;   ///< of each ray; empty: identity, so that residuals are in px
  bool known_sizes = false;                 ///< observe the bars with role used and the control points, hold what is to be held
  double bar_ratio = 1.0;                   ///< by which the sigmas of the bars are multiplied
  double control_ratio = 1.0;               ///< by which those of the control points are
  bool hold_points = false;
  bool hold_poses = false;
  std::vector<std::optional<Eigen::MatrixXd>> lens_prior;  ///< covariance about `lens_mean` of each camera, or empty
  std::vector<Eigen::VectorXd> lens_mean;
};

/// A model with its links to the survey. Block and group numbers are -1 where something does not take part.
struct NetworkModel {
  math::Model model;
  std::vector<int> camera_block;
  std::vector<int> mount_block;  ///< of each camera on a rig, the first of a rig aside
  std::vector<int> image_block;  ///< the pose of each image, or of its station
  std::vector<int> point_block;
  std::vector<int> ray_of_group;      ///< index of the ray of each measurement, -1 for others
  std::vector<int> bar_of_group;      ///< index of the bar of each measurement, -1 for others
  std::vector<int> control_of_group;  ///< index of the control group of each measurement, -1 for others

  /// The observation of a ray; its image and point must take part.
  [[nodiscard]] std::unique_ptr<math::ImagePoint> image_point(const Survey& survey, int ray,
                                                              const Eigen::Matrix2d& whitening) const;
};

NetworkModel build_model(const Survey& survey, const State& state, const ModelPlan& plan);
void read_back(const Survey& survey, const NetworkModel& network, State& state);

}  // namespace crosstie::bundle::detail
