#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "base/calibration.h"
#include "base/calibration_quality.h"
#include "base/machine.h"
#include "base/network.h"

namespace crosstie::base {

/// What a commissioning will tell of one error motion of the axis.
struct PlannedMotion {
  std::string name;  ///< as ErrorMotion
  int order = 1;
  bool angle = false;         ///< rad, else mm
  double sigma = 0.0;         ///< of its coefficient
  double smallest = 0.0;      ///< the coefficient that is found with the stated power
  double range_factor = 1.0;  ///< from a coefficient to peak to valley over the travel
  bool in_model = false;      ///< the scene has it so large that it takes part
};

/// A place in the machine where the head measures.
struct PlannedPoint {
  Eigen::Vector3d p_in_machine_mm = Eigen::Vector3d::Zero();
  double axis_mm = 0.0;                                     ///< reading at which the head stands before it
  Eigen::Matrix3d frame_cov_mm2 = Eigen::Matrix3d::Zero();  ///< by the machine frame alone
  /// Of one target measured there by both cameras: lenses, rig and frame with their correlations, and the noise of its two images;
  /// nothing where the cameras do not both see it.
  std::optional<Eigen::Matrix3d> cov_mm2 = {};
};

/// Sigmas to expect of a commissioning.
struct CommissionPlan {
  Commissioning expected;  ///< of observations without noise; its covariances belong to the sigmas as stated
  double level = 1e-3;     ///< of the tests of error motions and scale
  double power = 0.95;     ///< with which `smallest` is found
  std::vector<PlannedMotion> motions = {};
  double direction_sigma_rad = 0.0;  ///< the larger of the two across the direction
  double scale_smallest_ppm = 0.0;
};

/// Sigmas to expect of a photographic network: a priori ones.
struct NetworkPlan {
  AdjustedNetwork expected;
  double median_mm = 0.0;  ///< of the points' sigmas, each the largest in any direction
  double max_mm = 0.0;
};

/// One way in which a survey could be done otherwise, and what it would give.
struct PlanVariant {
  std::string what;               ///< "stations"
  std::string value;              ///< "3"
  bool as_planned = false;        ///< the scene as it stands
  std::string failure;            ///< why it gives nothing; then the figures below mean nothing
  std::vector<double> points_mm;  ///< largest sigma of each planned point: of a target measured there, else by the frame alone
  double direction_sigma_rad = 0.0;
  double scale_sigma_ppm = 0.0;
  double baseline_sigma_mm = 0.0;
  double straightness_mm =
      0.0;                ///< smallest parabola, peak to valley: the larger of EYX and EZX; not a number with two stations
  double roll_rad = 0.0;  ///< smallest linear EAX, EBX, ECX over the travel
  double pitch_rad = 0.0;
  double yaw_rad = 0.0;
  double network_median_mm = 0.0;  ///< of a photographic network
  double network_max_mm = 0.0;
};

/// A quantity of which many rehearsals tell whether its predicted covariance is true.
struct RehearsedQuantity {
  std::string name;
  int dof = 0;          ///< of one rehearsal
  double square = 0.0;  ///< mean of e' C^-1 e over the rehearsals, C as planned: near dof
  double low = 0.0;     ///< bounds of that mean that hold with probability 0.999
  double high = 0.0;

  [[nodiscard]] bool holds() const { return square >= low && square <= high; }
};

struct Rehearsal {
  int draws = 0;
  int failed = 0;                  ///< that gave no result
  std::string first_failure = {};  ///< why
  std::vector<RehearsedQuantity> quantities = {};
};

/// What a scene promises, without a photograph.
struct ScenePlan {
  std::string scene = {};
  double image_sigma_px = 0.0;                  ///< of a marker's coordinate
  double corner_sigma_px = 0.0;                 ///< of a board corner's
  std::optional<Calibration> calibration = {};  ///< of the head by its board
  std::optional<CalibrationMaps> maps = {};     ///< of that
  std::optional<CommissionPlan> machine = {};
  std::vector<PlannedPoint> points = {};
  std::optional<NetworkPlan> network = {};
  std::vector<PlanVariant> variants = {};
  std::optional<Rehearsal> rehearsal = {};
};

/// The largest standard deviation that a covariance has in any direction.
[[nodiscard]] double worst_sigma(const Eigen::Matrix3d& cov);

/// The body of `plan`.
nlohmann::ordered_json plan_json(const ScenePlan& plan);

}  // namespace crosstie::base
