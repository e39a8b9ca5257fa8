#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/network.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::bundle {

/// How image points are weighted against each other.
enum class ImageWeights {
  kDetector,  ///< by the covariance that the detector gives each centre, and a common part (AdjustOptions::model_sigma_px)
  kEqual,     ///< all alike with AdjustOptions::sigma_px, as classic bundle programs do
};

/// How large the sigmas of the groups of observations (image points of each camera, scale bars, control points) are by their residuals.
enum class VarianceComponents {
  kNone,   ///< not estimated
  kTell,   ///< estimated and told (AdjustedNetwork::variance_components); nothing else changes
  kApply,  ///< the sigmas of each group are multiplied by their ratio, until nothing changes; sigma0 is then 1 by construction
};

struct AdjustOptions {
  ImageWeights weights = ImageWeights::kDetector;

  /// A priori sigma of a coordinate with kEqual [px]. Default: 1/50 px, the order of what ellipse operators reach on signalised
  /// targets in practice; it scales sigma0 and the chi-square test, not the coordinates.
  double sigma_px = 0.02;

  /// Added in quadrature to the detector's sigmas with kDetector [px]: what a detector cannot see in one image (a target's own
  /// imperfection, the lens beyond its model). Default: none given, so it is estimated from the residuals as a variance
  /// component and sigma0 is 1 wherever it is larger than zero; the chi-square test then says nothing, and a warning says so.
  std::optional<double> model_sigma_px = {};

  /// Probability of rejecting a correct observation. Default: 0.001, the level of Baarda's data snooping
  /// (Publ. on Geodesy 2(5), Delft 1968), which is 3.3 sigma of a single coordinate.
  double significance = 0.001;

  /// false: every observation that can be computed takes part, whatever its residual.
  bool reject_outliers = true;

  /// true: dots without a code are matched between the images once the coded markers have oriented them, and adjusted with the
  /// rest. Default: true, since a group must be seen from three directions and be no chance (bundle/detail/uncoded.h).
  bool uncoded = true;

  /// What becomes of the variance components. Default: told, the stated sigmas count; a certificate is not overruled unasked by the
  /// residuals of a few bars.
  VarianceComponents variance_components = VarianceComponents::kTell;

  /// Points whose rays meet at less than this are left out [rad]: their depth would be noise. Default: 1 degree.
  double min_angle_rad = 0.0175;

  /// Pairs of images from which the network is built up, at most; the best outcome is kept. Default: 6, more than the
  /// two-fold ambiguity of planes needs.
  int start_pairs = 6;

  /// Ceres iterations of one minimisation, at most. Default: 100; ten are usual.
  int max_iterations = 100;

  /// false: AdjustedNetwork::covariance stays empty (its blocks in points, images and cameras are always there). Above 2000
  /// points the full matrix is left out in any case.
  bool full_covariance = true;

  /// An Error of code kUsage that names the member which is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

/// Bundle adjustment of a network with self-calibration: image points of markers go in, points, poses and lens
/// parameters with their covariance come out. Start values of poses and points are not needed; cameras need a focal length
/// good to some ten percent.
///
/// Model: image point = project(camera, network_from_camera^-1 * X) + noise (collinearity equations with the lens models of
/// base::Camera; Luhmann et al., Close-Range Photogrammetry, 3rd ed., ch. 4.4); a used scale bar observes |X_a - X_b|; a
/// camera's covariance, where it has one, is the prior of its parameters. Least squares in the whitened residuals.
///
/// Datum: inner constraints over all points (3 translations, 3 rotations), so that their covariance prefers none of them; the
/// scale comes from the used bars, or is defined by one (ScaleBarRole::kDefines, exact), or is free (then the scale is a
/// seventh inner constraint and the size that of a unit mean distance of the points from their centroid). Frame: origin in the
/// points' centroid, axes along their principal axes: x the longest, z the shortest and towards the cameras; x so that ids grow
/// along it.
///
/// Uncoded dots have no ids; images that agree on a place along their rays make one point of them (AdjustOptions::uncoded). These
/// get ids from 1001 on, or from one past the next thousand above the largest coded id, in the order of x in the frame; the number
/// of one that is rejected afterwards stays free. The frame is that of the coded points, with or without uncoded ones.
///
/// Outliers: a robust start, then data snooping after Baarda with the a priori sigma and Pope's tau with the a posteriori one;
/// everything rejected is listed with its reason in AdjustedNetwork::rejected.
///
/// Errors: kBadInput for inconsistent input (unknown camera, unknown bar end, a sigma that is not positive); kNoUniqueSolution
/// where the observations do not determine the network, naming what is weak: no scale, one image, one projection centre,
/// blocks without common points, parameters that nothing observes; kCancelled.
///
/// Deterministic: the same input and options give the same bytes.
base::Result<base::AdjustedNetwork> adjust(const base::Network& network, const AdjustOptions& options = {},
                                           const base::Progress& progress = {});

}  // namespace crosstie::bundle
