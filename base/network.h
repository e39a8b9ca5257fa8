#pragma once

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

namespace crosstie::base {

/// A camera as it enters an adjustment.
struct NetworkCamera {
  std::string name;
  Camera camera;         ///< start values; where its covariance is known, it is the prior of the parameters
  bool estimate = true;  ///< false: the parameters are taken as they are
};

/// What an adjustment starts from: who saw which marker where, and which lengths are known.
struct Network {
  std::vector<NetworkCamera> cameras;
  std::vector<ImageObservations> images;  ///< their `camera` names one of `cameras`; only coded markers are used so far
  std::vector<ScaleBar> scale_bars;
  bool scale_is_free = false;  ///< true: no scale is known and none is wanted; the result's unit is then arbitrary
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
};

struct AdjustedImage {
  std::string name;
  std::string camera;
  Pose network_from_camera;
  Matrix6d cov = Matrix6d::Zero();
  double rms_px = 0.0;
  int rays = 0;
};

struct AdjustedCamera {
  std::string name;
  Camera camera;  ///< with covariance
  bool estimated = true;
};

struct AdjustedScaleBar {
  ScaleBar bar;
  double measured_mm = 0.0;  ///< adjusted distance, at the bar's temperature
  double sigma_mm = 0.0;     ///< of measured_mm
  double w = 0.0;            ///< (measured - known) over the sigma of that difference
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
  double rms_px = 0.0;   ///< sqrt(sum |e|^2 / image points)
  int observations = 0;  ///< n: scalar observations that took part
  int unknowns = 0;      ///< u
  int conditions = 0;    ///< of the datum
  int redundancy = 0;    ///< n - u + conditions
  double chi2_p = 0.0;   ///< probability of a sigma0 at least this far from 1 (two-sided) if the a priori sigmas are true
  int iterations = 0;
  std::vector<AdjustedCamera> cameras;  ///< sorted by name, as all lists by name or id
  std::vector<AdjustedImage> images;
  std::vector<AdjustedPoint> points;
  std::vector<AdjustedScaleBar> scale_bars;
  std::vector<AdjustedObservation> residuals;  ///< by image, then point
  std::vector<RejectedObservation> rejected;
  std::vector<Warning> warnings;

  /// Full covariance: the estimated parameters of each camera in order, then 6 per image, then 3 per point, in `labels`' order.
  Eigen::MatrixXd covariance;
  std::vector<std::string> labels;  ///< "camera c043 fx [px]", "image 043_0005 rx [rad]", "point 11 x [mm]"
};

}  // namespace crosstie::base
