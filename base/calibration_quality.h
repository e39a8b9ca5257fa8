#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/pose.h"
#include "base/projection_map.h"

namespace crosstie::base {

/// What the covariance of a calibration says over its images, at one distance.
struct CalibrationMaps {
  double distance_mm = 0.0;
  std::vector<ProjectionSigmas> cameras;  ///< of each camera, against the boards
  /// Of a point that both cameras see: in the rig's frame, and against the boards. Of the calibration alone, without the noise of
  /// a measurement; nothing without a rig.
  std::optional<TriangulationSigmas> in_rig;
  std::optional<TriangulationSigmas> on_boards;
};

/// The corners of the board in a pair of images against the epipolar lines of the rig. The board's shape takes no part in it.
struct EpipolarPair {
  std::string station;
  int corners = 0;
  double mean_px = 0.0;      ///< signed distance of the right corners from the epipolar curves of the left ones
  double rms_px = 0.0;       ///< of that distance
  double max_px = 0.0;       ///< largest length
  double expected_px = 0.0;  ///< rms by the corners' sigma in both images (Calibration::sigma0_px)
};

/// A calibration against an earlier one of the same cameras; both are taken as independent.
struct CalibrationChange {
  struct Lens {
    std::string name;
    std::optional<ProjectionDifference> difference;  ///< of the earlier model (a) and this one (b)
    std::string failure;                             ///< why there is none
  };
  struct Rig {
    Vector6d change = Vector6d::Zero();  ///< from the earlier right_from_left to this one: [rad, mm], perturbation on the left
    Vector6d sigma = Vector6d::Zero();
    double baseline_before_mm = 0.0;
    double baseline_change_mm = 0.0;
    double baseline_sigma_mm = 0.0;  ///< of the change
  };
  std::string previous;  ///< the folder of the earlier result
  double distance_mm = 0.0;
  std::vector<Lens> cameras;
  std::optional<Rig> rig;  ///< where both have one
};

/// What is said of a calibration beside its values: keys `uncertainty`, `epipolar` and `change` of its result.
struct CalibrationQuality {
  std::optional<CalibrationMaps> maps;
  std::vector<EpipolarPair> epipolar;  ///< of each pair of images
  std::optional<CalibrationChange> change;
};

/// These keys, null where there is none; `cameras` are the names of the calibration's.
nlohmann::ordered_json calibration_quality_json(const CalibrationQuality& quality, const std::vector<std::string>& cameras);

}  // namespace crosstie::base
