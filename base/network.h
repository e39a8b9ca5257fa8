#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/observation.h"
#include "base/point_list.h"
#include "base/pose.h"
#include "base/result.h"
#include "base/scale_bar.h"
#include "base/variance_component.h"

namespace crosstie::base {

/// A camera as it enters an adjustment.
struct NetworkCamera {
  std::string name;
  /// Start values. Where their covariance is known, it is the prior of the parameters: 0 on its diagonal holds one, infinity tells
  /// nothing of it.
  Camera camera;
  bool estimate = true;  ///< false: the parameters are taken as they are
  std::vector<std::string> held =
      {};  ///< of the estimated ones those that stay at their start values, by base::parameter_names()
};

/// Cameras on one mount: where each of them sits relative to the first is unknown, but the same at all stations.
struct NetworkRig {
  std::string name;
  std::vector<std::string> cameras;                ///< the frame of the rig is that of the first
  std::vector<std::vector<std::string>> stations;  ///< the images of one moment, at most one of each camera
};

/// Coordinates that were determined together elsewhere, as observations in the frame of the result. A coordinate with a variance
/// of zero is held. Directions in which a singular covariance vanishes (the datum of the network it came from) are exact.
struct ControlGroup {
  std::vector<int> ids;
  Eigen::VectorXd xyz_mm;   ///< x y z of each id
  Eigen::MatrixXd cov_mm2;  ///< 3 n x 3 n, positive semi-definite
};

/// A point that tells where the frame of the result lies. See Network::datum.
struct DatumPoint {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  std::array<bool, 3> axes = {true, true, true};  ///< the coordinates that count; the others are only start values
};

struct StartPose {
  std::string image;
  Pose network_from_camera;
};

/// What an adjustment starts from: who saw which marker where, and what is known of lengths, points and poses.
struct Network {
  std::vector<NetworkCamera> cameras;
  std::vector<ImageObservations> images;  ///< their `camera` names one of `cameras`
  std::vector<NetworkRig> rigs;
  std::vector<ScaleBar> scale_bars;
  bool scale_is_free = false;         ///< true: no scale is known and none is wanted; the result's unit is then arbitrary
  std::vector<ControlGroup> control;  ///< independent of each other
  /// The frame is the one in which the sum of squares of the counting coordinates' differences is least: inner constraints where
  /// all coordinates of many points count, 3-2-1 or a minimally fixed datum where exactly as many count as are free. Where the
  /// scale is free, it is fitted, too. Empty: the control points; without these, the axes of the network itself.
  std::vector<DatumPoint> datum;
  std::vector<StartPose> start_poses;        ///< where known of all images, they are tried before start values are looked for
  std::vector<ReferencePoint> start_points;  ///< the same for points; what is missing is triangulated
  std::optional<double> dot_diameter_mm;     ///< of the coded markers: a scale that is far from it is refused
};

/// An observation that did not take part, and why.
struct RejectedObservation {
  std::string image;
  int id = kNoId;
  std::string reason;  ///< for people: "blunder", "moved between images", "one ray only", "wrong id", ...
  double w = 0.0;      ///< its standardised residual against the network, where there is one
};

/// An observation that took part.
struct AdjustedObservation {
  int image = 0;  ///< index into AdjustedNetwork::images
  int point = 0;  ///< index into AdjustedNetwork::points
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< adjusted minus measured
  Eigen::Vector2d sigma_px = Eigen::Vector2d::Zero();     ///< a priori, of x and y
  Eigen::Vector2d redundancy = Eigen::Vector2d::Zero();   ///< numbers of x and y, 0 (uncontrolled) to 1
  double w = 0.0;  ///< of both coordinates: sqrt(v' Qvv^-1 v / 2) over the a priori sigma; near 1 where the sigmas are true
};

struct AdjustedPoint {
  int id = 0;
  std::string kind = "coded";                        ///< coded, uncoded, sphere
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();  ///< in network
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
  int rays = 0;
  double angle_rad = 0.0;  ///< largest angle between two of its rays
  double rms_px = 0.0;     ///< sqrt(sum |e|^2 / rays)
  double max_w = 0.0;
  double max_px = 0.0;            ///< its longest residual
  double least_redundancy = 0.0;  ///< least redundancy number of its image coordinates
};

struct AdjustedImage {
  std::string name;
  std::string camera;
  Pose network_from_camera;
  Matrix6d cov = Matrix6d::Zero();
  double rms_px = 0.0;
  int rays = 0;
  double max_px = 0.0;    ///< its longest residual
  double coverage = 0.0;  ///< share of its area inside the upright rectangle round its points, 0..1
};

struct AdjustedCamera {
  std::string name;
  Camera camera;  ///< with covariance
  bool estimated = true;
  double coverage = 0.0;  ///< share of the image's cells (image_coverage.h) that hold points of any image, 0..1
  /// Of each parameter, in order: the probability of a value at least as far from 0 as this one if the true one were 0, by
  /// Student's t = value / sigma with the redundancy's degrees of freedom. Not a number for focal length and principal point,
  /// for constants of the model, and where a parameter was held; empty where none was estimated.
  Eigen::VectorXd significance_p = {};
};

struct AdjustedScaleBar {
  ScaleBar bar;
  double measured_mm = 0.0;  ///< adjusted distance, at the bar's temperature
  double sigma_mm = 0.0;     ///< of measured_mm
  double w = 0.0;            ///< (measured - known) over the sigma of that difference
};

/// Where a camera sits on its rig.
struct AdjustedMount {
  std::string camera;
  Pose rig_from_camera;
  Matrix6d cov = Matrix6d::Zero();  ///< zero for the first camera, whose frame is the rig's
};

struct AdjustedRig {
  std::string name;
  int stations = 0;  ///< that took part
  std::vector<AdjustedMount> mounts;

  /// Distance of the second camera's projection centre from the first's, and its sigma.
  [[nodiscard]] double baseline_mm() const;
  [[nodiscard]] double baseline_sigma_mm() const;
};

/// A control point in the adjustment.
struct AdjustedControl {
  int id = 0;
  Eigen::Vector3d residual_mm = Eigen::Vector3d::Zero();  ///< adjusted minus given
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();     ///< a priori; 0 where held
  double w = 0.0;                                         ///< standardised residual of its group over the a priori sigma
};

/// A dot without a code that belongs to no adjusted point.
struct UnmatchedDot {
  std::string image;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  bool ambiguous = false;  ///< it would fit more than one point; false: it fits none on which three images agree
};

/// What became of the dots without a code.
struct UncodedDots {
  int found = 0;                   ///< in the oriented images, with the dots of rings that could not be read
  int matched = 0;                 ///< told to be images of common points
  int targets = 0;                 ///< such points
  std::vector<UnmatchedDot> left;  ///< by image, y, x
};

/// Where the scalar observations come from.
struct ObservationCounts {
  int image_coordinates = 0;
  int scale_bars = 0;
  int control_coordinates = 0;
  int lens_parameters = 0;  ///< what was known of lenses beforehand

  [[nodiscard]] int total() const { return image_coordinates + scale_bars + control_coordinates + lens_parameters; }
};

/// What the unknowns are.
struct UnknownCounts {
  int interior = 0;  ///< parameters of lenses
  int exterior = 0;  ///< poses of images, or of stations where the cameras are on a rig
  int rig = 0;       ///< where cameras sit on their rigs
  int object = 0;    ///< coordinates of points

  [[nodiscard]] int total() const { return interior + exterior + rig + object; }
};

/// The outcome of an adjustment. Covariances are a posteriori (multiplied by sigma0^2) in the stated datum.
struct AdjustedNetwork {
  std::string datum;       ///< "inner constraints", ...
  std::string scale;       ///< where the scale comes from: "scale bars", "defined by 11-52", "free"
  double sigma0 = 0.0;     ///< a posteriori over a priori, without unit
  double sigma0_px = 0.0;  ///< a posteriori sigma of one image coordinate of unit weight (the median a priori sigma)
  /// Added in quadrature to the detector's sigmas of all image points, given or estimated as a variance component; 0 for equal
  /// weights. Where it was estimated, sigma0 is 1 by construction.
  double model_sigma_px = 0.0;
  double uncoded_model_sigma_px = 0.0;  ///< the same of uncoded targets, which have a component of their own
  double rms_px = 0.0;                  ///< sqrt(sum |e|^2 / image points)
  int observations = 0;                 ///< n: scalar observations that took part
  int unknowns = 0;                     ///< u
  int conditions = 0;                   ///< of the datum
  int redundancy = 0;                   ///< n - u + conditions
  double chi2_p = 0.0;         ///< probability of a sigma0 at least this far from 1 (two-sided) if the a priori sigmas are true
  ObservationCounts observed;  ///< parts of `observations`
  UnknownCounts estimated;     ///< parts of `unknowns`
  int iterations = 0;
  double last_step = 0.0;  ///< how far the last iteration moved all predictions together, in a priori sigmas
  /// Rank of the design matrix as its pattern of zeros allows: u, unless something has fewer observations than unknowns.
  int structural_rank = 0;
  int rank = 0;  ///< by the eigenvalues of its normal matrix: u less the directions that only the datum determines
  /// Least eigenvalue of the reduced normal matrix, scaled to unit diagonal, in the datum: near 0 where a combination of unknowns
  /// is hardly determined; and the unknowns that dominate its eigenvector.
  double least_eigenvalue = 0.0;
  std::string weakest;
  std::vector<AdjustedCamera> cameras;  ///< sorted by name, as all lists by name or id
  std::vector<AdjustedImage> images;
  std::vector<AdjustedPoint> points;
  std::vector<AdjustedRig> rigs;
  std::vector<AdjustedScaleBar> scale_bars;
  std::vector<AdjustedControl> control;
  std::vector<AdjustedObservation> residuals;  ///< by image, then point
  std::vector<RejectedObservation> rejected;
  UncodedDots uncoded;
  /// Of the image points of each camera, the scale bars and the control points, together (math/variance_components.h); empty without
  /// redundancy.
  std::vector<VarianceComponent> variance_components;
  /// True: the sigmas were multiplied by these ratios, so that sigma0 is 1 by construction; false: they are only told.
  bool variance_components_applied = false;
  std::vector<Warning> warnings;

  /// Full covariance: the estimated parameters of each camera in order, then 6 per mount and image (per station where the camera
  /// is on a rig), then 3 per point, in `labels`' order.
  Eigen::MatrixXd covariance;
  std::vector<std::string> labels;  ///< "camera c043 fx [px]", "image 043_0005 rx [rad]", "point 11 x [mm]"
};

}  // namespace crosstie::base
