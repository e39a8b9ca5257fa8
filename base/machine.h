#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/certificate.h"
#include "base/point_list.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// A ball of the cross.
struct ReferenceSphere {
  int id = 0;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< in cross
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();    ///< of the centre; not used where Cross::cov_mm2 is given
  double diameter_mm = 0.0;                             ///< 0: not known
};

/// The calibration cross: markers and balls whose places relative to each other are known. It is bolted to the machine and stays.
/// Its coordinates are those at `measured_at_c`; on the machine it is longer by growth().
struct Cross {
  std::vector<ReferencePoint> markers;   ///< in cross
  std::vector<ReferenceSphere> spheres;  ///< in the same frame
  /// Joint covariance of all coordinates, x y z of each marker, then of each sphere. Directions in which it vanishes (the datum of the
  /// network it came from) are exact. Empty: each point with its own covariance, independent of the others.
  Eigen::MatrixXd cov_mm2 = {};
  double measured_at_c = 20.0;  ///< temperature to which the coordinates refer
  double temperature_c = 20.0;  ///< on the machine
  double temperature_sigma_c = 0.0;
  double cte_per_k = 0.0;
  double cte_sigma_per_k = 0.0;
  Certificate certificate = {};

  /// Relative change of all lengths from the list to the machine, CTE (T - T_list), and its sigma, from those of both.
  [[nodiscard]] double growth() const { return cte_per_k * (temperature_c - measured_at_c); }
  [[nodiscard]] double growth_sigma() const;
  /// kBadInput: an id twice, values that are not finite, a covariance that is missing, of the wrong size or not symmetric.
  [[nodiscard]] Result<> validate() const;
};

/// The centre of a ball as the machine's touch probe found it.
struct ProbedSphere {
  int id = 0;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< in machine
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
  std::optional<double> diameter_mm = {};  ///< as probed, where it was free: held against the reference
  double diameter_sigma_mm = 0.0;
  /// The machine coordinates that count for the frame: all for a weighted best fit; 3-2-1 and RPS lock single ones.
  std::array<bool, 3> axes = {true, true, true};
};

/// The head at one place of its travel, and the names of the photographs of the cross that it took there; empty: none.
struct Station {
  std::string name;
  double axis_mm = 0.0;  ///< the reading of the X axis
  std::string left;
  std::string right;
};

/// The two cameras of the scanning head as calibrate left them. The rig frame is the left camera's.
struct Head {
  std::string left_name = "left";
  std::string right_name = "right";
  Camera left;
  Camera right;
  Pose right_from_left;
  /// Joint covariance: parameters of the left camera, of the right camera, right_from_left [rad, mm]. 0 on the diagonal holds a
  /// value. Empty: the lenses are exact and nothing is known of the rig.
  Eigen::MatrixXd cov = {};
  std::optional<double> temperature_c = {};  ///< of the cameras while they were calibrated

  [[nodiscard]] int parameter_count() const {
    return base::parameter_count(left.model()) + base::parameter_count(right.model()) + 6;
  }
};

/// One term of an error motion of the X axis after ISO 230-1, coefficient * P_order(t): P the Legendre polynomial, t = -1 at the first
/// and +1 at the last reading of the travel.
///   EXX positioning, EYX and EZX straightness [mm]: order 2 and above (0 belongs to the head's pose, 1 to direction and scale)
///   EAX roll, EBX pitch, ECX yaw [rad]: order 1 and above (0 belongs to the head's pose)
struct ErrorMotion {
  std::string name;  ///< "EYX", ...
  int order = 1;
  bool angle = false;        ///< rad, else mm
  double coefficient = 0.0;  ///< as its test found it, the others that are significant beside it
  double sigma = 0.0;
  double p = 1.0;  ///< probability of a coefficient at least as far from 0 if the true one were 0
  bool significant = false;
  /// It takes part in the axis with `value`: free where it is significant, else drawn to 0 by a prior whose sigma is as large as what the
  /// test found, since a motion that is too small to be proved is not proved to be none.
  bool in_frame = false;
  double value = 0.0;
};

/// P_order(t).
[[nodiscard]] double legendre(int order, double t);

/// The travel of the head:
///     machine_from_rig(s) = Trans(d (s - s0) (1 + k) + (EXX, EYX, EZX)(s)) * Rot_q((EAX, EBX, ECX)(s)) * machine_from_rig(s0)
/// with s the axis reading, s0 the middle of the travel, d the direction, k the encoder's scale, all in the machine's axes. Rot_q
/// turns about the point q of the carriage to which direction, scale and straightness belong: q is `pivot_mm` + d s0 in machine when
/// the reading is s0 (pivot_mm when it is 0).
struct LinearAxis {
  Eigen::Vector3d direction_in_machine = Eigen::Vector3d::UnitX();  ///< of growing readings; unit length
  Eigen::Matrix3d direction_cov = Eigen::Matrix3d::Zero();          ///< of its components; singular along itself
  double scale_ppm = 0.0;                                           ///< k
  double scale_sigma_ppm = 0.0;
  double scale_p = 1.0;            ///< see ErrorMotion::p
  bool scale_significant = false;  ///< the scale takes part in either case
  std::vector<ErrorMotion> terms;  ///< all that were tested
  double level = 1e-3;             ///< of the tests, each
  double from_mm = 0.0;            ///< readings of the first and the last station: the travel
  double to_mm = 0.0;
  Eigen::Vector3d pivot_mm = Eigen::Vector3d::Zero();
  /// Scatter of a stop round this model beside the reading's own sigma: of each coordinate and of each angle. 0 where the stations show
  /// none.
  double stop_sigma_mm = 0.0;
  double stop_sigma_rad = 0.0;
  double reading_sigma_mm = 0.0;

  [[nodiscard]] double middle_mm() const { return 0.5 * (from_mm + to_mm); }
  /// Value of an error motion at a reading, from the terms that take part [mm or rad].
  [[nodiscard]] double value(const std::string& name, double axis_mm) const;
};

/// The head's pose at a reading of the axis.
struct HeadPose {
  double axis_mm = 0.0;
  Pose machine_from_rig = {};
  Matrix6d cov = Matrix6d::Zero();       ///< of the model's pose, which all stops share
  Matrix6d stop_cov = Matrix6d::Zero();  ///< of a single stop about it, and of its reading: to be added for one stop
};

/// Where the head is in machine, for every reading of its travel.
struct MachineFrame {
  LinearAxis axis = {};
  Pose machine_from_rig_at_middle = {};  ///< on the axis at LinearAxis::middle_mm(), without error motions
  /// Two unit vectors across the direction; the direction's perturbation is their combination.
  Eigen::Matrix<double, 3, 2> across = Eigen::Matrix<double, 3, 2>::Zero();
  /// Joint covariance of machine_from_rig_at_middle [rad, mm], the direction's two perturbations [rad], the scale [ppm] and each
  /// term that takes part [mm or rad], in their order.
  Eigen::MatrixXd cov = {};

  /// Error kBadInput where `axis_mm` lies outside of the travel: nothing is known of the error motions there.
  [[nodiscard]] Result<HeadPose> at(double axis_mm) const;
  /// Derivatives of the perturbation of at(axis_mm) by the parameters of `cov`, in their order: 6 x cov.rows().
  [[nodiscard]] Eigen::MatrixXd jacobian(double axis_mm) const;
  /// Sigma of the value of axis.terms[index] beside everything else that is unknown [mm or rad]; nothing where the term takes no part.
  [[nodiscard]] std::optional<double> term_sigma(std::size_t index) const;
  /// The pose on the straight axis, without error motions, anywhere; its covariance says nothing of them.
  [[nodiscard]] HeadPose straight_at(double axis_mm) const;
};

/// A ball in the adjustment.
struct CommissionedSphere {
  int id = 0;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< adjusted, in machine
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
  Eigen::Vector3d residual_mm = Eigen::Vector3d::Zero();  ///< adjusted minus probed, in machine
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();     ///< of the probing, a priori
  double w = 0.0;                                         ///< standardised residual of its counting coordinates
  std::array<bool, 3> axes = {true, true, true};
  /// Where all the others put it, minus where it was probed; nothing where they do not determine it.
  std::optional<Eigen::Vector3d> left_out_mm = {};
  Eigen::Vector3d left_out_sigma_mm = Eigen::Vector3d::Zero();  ///< of that difference
};

/// A marker of the cross in the adjustment.
struct CommissionedMarker {
  int id = 0;
  int rays = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();       ///< adjusted, in cross, at the machine's temperature
  Eigen::Vector3d residual_mm = Eigen::Vector3d::Zero();  ///< adjusted minus given (at the adjusted growth), in cross
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();     ///< of the list, a priori
};

/// A station in the adjustment.
struct CommissionedStation {
  std::string name;
  double axis_mm = 0.0;
  Pose machine_from_rig = {};  ///< of this stop, its own scatter included
  Matrix6d cov = Matrix6d::Zero();
  Vector6d off_axis = Vector6d::Zero();  ///< from the model's pose to this one: [rad, mm] in the machine's axes
  double w = 0.0;                        ///< standardised
  double off_along_mm = 0.0;             ///< part of off_axis along the direction: the reading's residual
};

struct CommissionedImage {
  std::string name;
  std::string camera;
  int station = 0;  ///< index into Commissioning::stations
  int rays = 0;
  double rms_px = 0.0;
  double max_px = 0.0;
};

struct CommissionedRay {
  int image = 0;  ///< index into Commissioning::images
  int id = 0;
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< adjusted minus measured
  Eigen::Vector2d sigma_px = Eigen::Vector2d::Zero();     ///< as it was weighted
  double w = 0.0;                                         ///< sqrt(v' Qvv^-1 v / 2)
};

/// One kind of observation: how its residuals compare with its sigmas.
struct ObservationGroup {
  std::string name;  ///< "image points", "cross", "spheres", "axis", "calibration", "temperature"
  int observations = 0;
  double redundancy = 0.0;  ///< sum of its redundancy numbers
  double ratio = 0.0;       ///< v'Pv / redundancy: near 1 where its sigmas are true; 0 without redundancy
};

/// What the frame adds to the uncertainty of a point of the working volume (target registration error).
struct FramePoint {
  double axis_mm = 0.0;
  Eigen::Vector3d p_in_rig_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_in_machine_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
};

/// What commission found. Covariances belong to sigmas as stated, those of the image points times image_sigma_factor.
struct Commissioning {
  Head head;  ///< lenses and rig as adjusted, with their covariance
  double baseline_mm = 0.0;
  double baseline_sigma_mm = 0.0;
  MachineFrame frame = {};
  /// frame.at(0), or frame.straight_at(0) where 0 lies outside of the travel.
  HeadPose machine_from_rig_at_zero = {};
  bool zero_in_travel = false;
  Pose machine_from_cross = {};
  Matrix6d machine_from_cross_cov = Matrix6d::Zero();
  double growth_ppm = 0.0;  ///< of the cross, adjusted
  double growth_sigma_ppm = 0.0;
  double growth_stated_ppm = 0.0;
  double growth_stated_sigma_ppm = 0.0;

  std::vector<CommissionedSphere> spheres = {};  ///< by id
  double fre_mm = 0.0;                           ///< sqrt(mean squared length of the spheres' residuals)
  /// Distances between the balls as probed over those of the (grown) list, minus 1, and its sigma: a check, it takes no part.
  double sphere_scale_ppm = 0.0;
  double sphere_scale_sigma_ppm = 0.0;
  std::vector<FramePoint> tre = {};                ///< over the working volume
  std::vector<HeadPose> checked_at = {};           ///< at the stations' readings
  std::vector<CommissionedStation> stations = {};  ///< by reading
  std::vector<CommissionedImage> images = {};
  std::vector<CommissionedRay> residuals = {};
  std::vector<CommissionedMarker> markers = {};  ///< by id
  struct Rejected {
    std::string subject;  ///< "image x0850_l", "sphere 3", "station x0850"
    int id = -1;          ///< of the marker, -1: none
    std::string reason;
    double w = 0.0;
  };
  std::vector<Rejected> rejected = {};

  std::string datum = {};                ///< "best fit of 4 spheres", "3-2-1 of spheres 1 2 3", ...
  double sigma0 = 0.0;                   ///< of all observations as weighted
  double image_sigma_factor = 1.0;       ///< a posteriori over stated sigmas of the image points; estimated unless held
  double sigma0_px = 0.0;                ///< median sigma of an image coordinate, times that factor
  double rms_px = 0.0;                   ///< sqrt(sum |e|^2 / image points)
  double largest_eccentricity_px = 0.0;  ///< correction from ellipse to circle centres
  std::vector<ObservationGroup> groups = {};
  int observations = 0;
  int unknowns = 0;
  int redundancy = 0;
  double chi2_p = 0.0;  ///< probability of a sum of squares at least this far from its expectation
  int iterations = 0;
  double least_eigenvalue = 0.0;
  std::string weakest = {};
  std::vector<Warning> warnings = {};

  /// Joint covariance, in `labels`' order: left lens, right lens, right_from_left, machine_from_rig at the middle, the direction's two
  /// perturbations, scale, the terms that take part, machine_from_cross, growth, then x y z of each marker of `markers`.
  /// "camera left fx [px]", "rig rx [rad]", "head rx [rad]", "axis across 1 [rad]", "axis scale [ppm]", "axis EBX1 [rad]",
  /// "cross rx [rad]", "cross growth [ppm]", "marker 11 x [mm]"
  Eigen::MatrixXd covariance = {};
  std::vector<std::string> labels = {};
};

/// What one new pair of photographs says of the head and its frame.
struct HeadCheck {
  enum class Verdict {
    kHolds,         ///< nothing contradicts the commissioning
    kRig,           ///< the cameras moved against each other
    kHeadOrCross,   ///< the head on its carriage, or the cross on the machine: one pair cannot tell which
    kHead,          ///< the head moved: a second reference says that the cross did not
    kCross,         ///< the cross moved: a second reference says so
    kHeadAndCross,  ///< both
  };
  struct Test {
    std::string name;  ///< "rig", "head against cross", "spheres"; "relative pitch", "yaw", ...
    std::string unit;  ///< of value and sigma; empty: without unit
    double value = 0.0;
    double sigma = 0.0;      ///< 0 for tests of several values together
    double statistic = 0.0;  ///< chi-square
    int dof = 0;
    double p = 1.0;
    bool accused = false;  ///< p below the level of this test
  };
  double axis_mm = 0.0;
  Verdict verdict = Verdict::kHolds;
  std::string message;  ///< for people
  double level = 1e-3;  ///< probability that a head as it was is accused
  std::vector<Test> tests;
  int common_markers = 0;                  ///< seen by both cameras
  int cross_markers = 0;                   ///< rays of markers of the cross
  Vector6d rig_change = Vector6d::Zero();  ///< right_from_left now against then [rad, mm]; only what `rig_seen` tells
  Vector6d rig_change_sigma = Vector6d::Zero();
  std::array<bool, 6> rig_seen = {};        ///< determined by this pair
  Vector6d head_change = Vector6d::Zero();  ///< machine_from_rig now (through the cross) against the frame [rad, mm]
  Vector6d head_change_sigma = Vector6d::Zero();
  double epipolar_rms_px = 0.0;  ///< of markers that both cameras see, from the epipolar lines of the rig as commissioned
  double rms_px = 0.0;           ///< of the markers against the cross, pose free
  std::vector<Commissioning::Rejected> rejected;
  std::vector<Warning> warnings;
};

/// "holds", "rig", "head or cross", "head", "cross", "head and cross".
[[nodiscard]] std::string_view verdict_name(HeadCheck::Verdict verdict);

}  // namespace crosstie::base
