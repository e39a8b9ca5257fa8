#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/machine.h"
#include "bundle/commission.h"
#include "bundle/detail/axis_motion.h"
#include "bundle/detail/head_survey.h"
#include "bundle/detail/sphere_pairs.h"
#include "math/model.h"

namespace crosstie::bundle::detail {

/// What a row group of the model is.
struct HeadGroup {
  enum class Kind { kImagePoint, kListed, kSphere, kAxis, kMotion, kCalibration, kTemperature };
  Kind kind = Kind::kImagePoint;
  int index = 0;  ///< of the ray, the pair, the station; 0 of a prior
};

/// The unknowns of a commissioning and where they stand in the model.
struct HeadModel {
  math::Model model;
  std::vector<HeadGroup> groups;  ///< of each measurement
  int left = -1;
  int right = -1;
  int mount_left = -1;   ///< held at zero
  int mount_right = -1;  ///< rig_from_camera
  int machine_from_cross = -1;
  int growth = -1;
  std::vector<int> markers;  ///< -1: not seen, only in a joint list
  std::vector<int> spheres;  ///< of Cross::spheres; -1: not used
  std::vector<int> stations;
  int at_middle = -1;  ///< -1: the stations are free of each other
  int direction = -1;
  int scale = -1;
  int terms = -1;  ///< -1: there are none
};

/// Where everything is, as far as it is known.
struct HeadState {
  Eigen::VectorXd left;
  Eigen::VectorXd right;
  base::Pose rig_from_right;
  base::Pose machine_from_cross;
  double growth_ppm = 0.0;
  std::vector<Eigen::Vector3d> markers;  ///< at the machine's temperature
  std::vector<Eigen::Vector3d> spheres;
};

/// The axis as it enters the model.
struct AxisModel {
  Carriage carriage;
  base::Pose at_middle;
  double scale_ppm = 0.0;
  double stop_sigma_mm = 0.0;
  double stop_sigma_rad = 0.0;
};

[[nodiscard]] HeadState start_state(const CommissionInput& input, const base::Pose& machine_from_cross);

/// `image_sigma_factor` multiplies the sigmas of image points. Without `axis` the stations are free of each other.
base::Result<HeadModel> build_head_model(const CommissionInput& input, const HeadSurvey& survey, const SpherePairs& spheres,
                                         const HeadState& state, double image_sigma_factor, const AxisModel* axis);

/// The values of the unknowns back into state and survey (stations' poses).
void read_back(const HeadModel& head, HeadState& state, HeadSurvey& survey);

}  // namespace crosstie::bundle::detail
