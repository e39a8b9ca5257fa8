#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/board.h"
#include "base/calibrated_area.h"
#include "base/camera.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// Two lens parameters that say nearly the same.
struct ParameterCorrelation {
  std::string a;
  std::string b;
  double value = 0.0;
};

struct CalibratedCamera {
  std::string name;
  Camera camera;  ///< with covariance, and the hull of its corners as its valid region
  int views = 0;
  int corners = 0;
  double rms_px = 0.0;  ///< sqrt(sum |e|^2 / corners), OpenCV's definition
  /// The same of views that took no part (their poses only were fitted), pooled over the folds; 0: no cross-validation was asked for.
  double rms_heldout_px = 0.0;
  std::optional<double> temperature_c = {};  ///< of the camera while it took the images; nothing where nobody said
  CalibratedArea area = {};
  /// Of each parameter: probability of a value at least as far from 0 if the true one were 0 (Student's t); not a number for focal
  /// length and principal point.
  Eigen::VectorXd significance_p = {};
  std::vector<ParameterCorrelation> correlations = {};  ///< those above 0.95, without fx with fy
};

/// Two cameras that are bolted to each other; the first is the rig's frame.
struct CalibratedRig {
  std::string left;
  std::string right;
  Pose right_from_left;
  Matrix6d cov = Matrix6d::Zero();
  double baseline_mm = 0.0;  ///< distance of the projection centres
  double baseline_sigma_mm = 0.0;
  int stations = 0;  ///< that both cameras saw
};

/// The board as it was found to be.
struct CalibratedBoard {
  struct Mode {
    std::string name;
    std::string unit;
    double prior_sigma = 0.0;
    double value = 0.0;
    double sigma = 0.0;
  };
  Board board;
  std::vector<Mode> modes;       ///< empty for a board that is taken as nominal
  Eigen::Matrix3Xd points;       ///< [mm] of all, in the board frame; nominal ones where none were estimated
  Eigen::Matrix3Xd sigma;        ///< [mm] of their coordinates
  double bend_rms_mm = 0.0;      ///< out of the best plane
  double in_plane_rms_mm = 0.0;  ///< left after shift, turn and scale in the plane
  /// Sum of squares of the shape's deviations over their prior sigmas, over its redundancy: near 1 where the prior is true, far
  /// above it where the board is worse than was said. 0 for a nominal board.
  double prior_ratio = 0.0;
};

struct CalibratedView {
  std::string image;
  std::string camera;
  int station = 0;  ///< index into Calibration::stations
  Pose board_from_camera;
  int corners = 0;  ///< that took part
  int rejected = 0;
  double rms_px = 0.0;
  double max_px = 0.0;       ///< the longest residual
  double distance_mm = 0.0;  ///< of the board's middle from the projection centre
  double tilt_rad = 0.0;     ///< of the board's normal against the line of sight
};

/// A moment: the board's pose against the rig (or against the only camera that saw it).
struct CalibratedStation {
  std::string name;
  bool paired = false;  ///< seen by both cameras
  Pose board_from_rig;  ///< of an unpaired view: board_from_camera
};

/// A corner that took part.
struct CalibrationResidual {
  int view = 0;    ///< index into Calibration::views
  int corner = 0;  ///< index on the board
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< adjusted minus measured
  double sigma_px = 0.0;                                  ///< a priori of either coordinate
  double w = 0.0;  ///< sqrt(v' Qvv^-1 v / 2) over the a priori sigma; near 1 where all is as stated
};

/// A corner, or a whole image, that took no part.
struct RejectedCorner {
  std::string image;
  int corner = -1;  ///< -1: the image
  std::string reason;
  double w = 0.0;
};

/// A lens model or detector was tried on part of the views.
struct HeldOutFold {
  std::string name;            ///< "odd", "even", "1 of 5"
  int stations = 0;            ///< that took part in the solve
  std::vector<double> rms_px;  ///< of each camera over the views held out: their poses only were fitted, camera by camera
  double baseline_mm = 0.0;    ///< 0 without a rig
  double baseline_sigma_mm = 0.0;
};

/// How well the calibration predicts what it has not seen.
struct CrossValidation {
  std::vector<HeldOutFold> halves;  ///< odd and even stations
  std::vector<HeldOutFold> folds;   ///< k-fold; empty where there are too few stations
  double baseline_gap_mm = 0.0;     ///< of the halves, even minus odd
  /// Of the gap as the covariances of both halves predict it, their common board taken into account.
  double baseline_gap_sigma_mm = 0.0;
  /// Of each camera: the rms difference of the halves' projections within 0.4 image heights of the middle, after the rotation that
  /// takes most of it away; and what their covariances predict for it [px].
  std::vector<double> model_difference_px;
  std::vector<double> model_difference_predicted_px;
};

/// One step of the ladder of lens models.
struct LensTrial {
  LensModel lens = LensModel::kOpenCv5;
  double rms_px = 0.0;          ///< of all corners in the solve with all views
  double rms_heldout_px = 0.0;  ///< of all corners over the folds
  /// Mean difference of the held-out views' mean squares from the best trial's, over its sigma (paired over views): above 1 the model
  /// is worse than the best.
  double worse_by_sigmas = 0.0;
  bool chosen = false;
  std::string failure;  ///< why there is no result; empty where there is one
};

/// A corner detector on the same images.
struct DetectorTrial {
  std::string detector;  ///< "classic", "sb"
  int images = 0;        ///< in which it found the board
  int corners = 0;
  double difference_px = 0.0;  ///< rms distance of its corners from those that were used
  double rms_px = 0.0;
  std::vector<double> focal_px;  ///< fx of each camera
  double baseline_mm = 0.0;
  bool used = false;
  std::string failure;
};

/// The same corners solved by another program.
struct SecondOpinion {
  std::string program;  ///< "mrcal 2.2"; empty: there is none
  LensModel lens = LensModel::kOpenCv4;
  std::string board;                        ///< how it models the board: "rigid", "two bends"
  double rms_px = 0.0;                      ///< OpenCV's definition
  std::vector<Eigen::VectorXd> parameters;  ///< of each camera
  std::optional<Pose> right_from_left;
  double baseline_mm = 0.0;
  /// Our own solve under its assumptions, and how far it is from the other program's.
  double our_rms_px = 0.0;
  std::vector<double> our_focal_px;
  double our_baseline_mm = 0.0;
  int rejected = 0;  ///< corners that it left out
  std::string failure;
  Eigen::Vector2d bends_mm = Eigen::Vector2d::Zero();  ///< "two bends": rise of the board's middle along columns and along rows
  /// Of each camera: rms and maximum of the difference between its projections and those of the calibration itself, at distance_mm
  /// where corners were seen, after the implied motion (math::projection_difference).
  std::vector<double> difference_rms_px;
  std::vector<double> difference_max_px;
  double distance_mm = 0.0;
};

/// What calibrate found. Covariances belong to the corner sigma that the residuals tell and to the board's prior as stated.
struct Calibration {
  std::vector<CalibratedCamera> cameras;  ///< left first
  std::optional<CalibratedRig> rig;
  CalibratedBoard board;
  std::vector<CalibratedStation> stations;
  std::vector<CalibratedView> views;  ///< by station, left first
  std::vector<CalibrationResidual> residuals;
  std::vector<RejectedCorner> rejected;

  double sigma0 = 0.0;     ///< sqrt(v'Pv / redundancy), the prior with it: near 1 by construction, see sigma0_px
  double sigma0_px = 0.0;  ///< standard deviation of one coordinate of a corner, as the residuals tell it (variance component)
  double rms_px = 0.0;     ///< of all corners
  int observations = 0;
  int unknowns = 0;
  int redundancy = 0;
  int iterations = 0;
  std::string weakest;            ///< the unknowns that dominate the least determined combination
  double least_eigenvalue = 0.0;  ///< of the scaled normal matrix, see AdjustedNetwork

  std::optional<CrossValidation> validation;
  std::vector<LensTrial> ladder;
  std::vector<DetectorTrial> detectors;
  std::optional<SecondOpinion> second_opinion;
  std::vector<Warning> warnings;

  /// Joint covariance of what is kept: the lens parameters of each camera, right_from_left, the board's modes, then board_from_rig of
  /// every station, in `labels`' order: "camera left fx [px]", "rig rx [rad]", "board scale [ppm]", "station 01 rx [rad]".
  Eigen::MatrixXd covariance;
  std::vector<std::string> labels;
};

}  // namespace crosstie::base
