#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// One measured point against its reference.
struct Deviation {
  int id = 0;
  Eigen::Vector3d reference_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d measured_mm = Eigen::Vector3d::Zero();       ///< transformed into the reference's frame
  Eigen::Vector3d deviation_mm = Eigen::Vector3d::Zero();      ///< measured - reference after the fit
  Eigen::Vector3d untransformed_mm = Eigen::Vector3d::Zero();  ///< measured - reference as they stand
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();  ///< predicted, of both sides where given; 0 where neither gives any
  bool used = true;                                    ///< in the fit
  int reference_id = 0;  ///< of its partner: its own id, but for a point that was paired by position
};

/// Points without ids of their own (uncoded targets), each with the nearest point of the reference after the fit.
struct PositionComparison {
  double gate_mm = 0.0;           ///< partners lie nearer than this
  std::vector<Deviation> points;  ///< sorted by id; none is used in the fit
  std::vector<int> unpaired;      ///< measured, with no free partner inside of the gate
  Eigen::Vector3d rms_mm = Eigen::Vector3d::Zero();
  double rms3d_mm = 0.0;
  double max_mm = 0.0;
  double normalised_rms = 0.0;  ///< as Verification::normalised_rms
};

/// A distance between two points that did not serve to define the scale.
struct LengthDeviation {
  int id_a = 0;
  int id_b = 0;
  double nominal_mm = 0.0;
  double measured_mm = 0.0;
  double sigma_mm = 0.0;  ///< predicted, 0 where unknown
  double mpe_mm = 0.0;    ///< maximum permissible error A + L/K of the job
};

/// Results against a reference: a rigid best fit, deviations per axis, test lengths.
struct Verification {
  std::string fit = "rigid";  ///< "rigid" (6), "similarity" (7), "none" (0 degrees of freedom)
  Pose reference_from_measured;
  Matrix6d pose_cov = Matrix6d::Zero();
  double scale_ppm = 0.0;  ///< (scale - 1) * 1e6 of a similarity fit: a check where `fit` is rigid
  double scale_sigma_ppm = 0.0;
  std::vector<Deviation> points;  ///< sorted by id
  std::vector<LengthDeviation> lengths;
  std::vector<int> only_measured;  ///< ids without a partner
  std::vector<int> only_reference;
  PositionComparison by_position;
  Eigen::Vector3d rms_mm = Eigen::Vector3d::Zero();  ///< per axis, over the used points
  double rms3d_mm = 0.0;
  double max_mm = 0.0;          ///< largest 3D deviation
  double normalised_rms = 0.0;  ///< per coordinate: deviation over predicted sigma; 0 where no sigma is known
  double length_rms_mm = 0.0;
  double length_max_mm = 0.0;
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
