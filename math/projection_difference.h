#pragma once

#include "base/camera.h"
#include "base/projection_map.h"
#include "base/result.h"

namespace crosstie::math {

struct ProjectionDifferenceOptions {
  /// [mm] Distance along the ray at which the models are compared. Default: 0, at infinity.
  double distance_mm = 0.0;
  /// Cells in a row of the grid. Default: 40.
  int columns = 40;
  /// [px] Only cells within this radius of the image's middle decide on the motion, and on rms and max. Default: 0, all in which both
  /// models are calibrated.
  double radius_px = 0.0;
  /// Level of the test whether the difference is more than the covariances of both models predict. Default: 1e-3.
  double significance = 1e-3;

  [[nodiscard]] base::Result<> validate() const;
};

/// Compares two models of one camera by where they project.
///
/// The same images lead to lens parameters that differ by much more than their projections, since a camera that is turned a
/// little sees nearly the same picture as one whose principal point is moved. So a motion of the camera's frame is fitted first: the
/// rotation, and for a finite distance the translation, that minimises
///     sum over cells | project_b(b_from_a * distance * unproject_a(q)) - q |^2
/// with equal weights over the cells in which both models are calibrated (Camera::calibrated_at; within the radius). What is left
/// is the difference. Its covariance follows from those of both models, taken as independent, to first order, the fit of the motion
/// included. Whether the difference exceeds them is tested by its sum of squares (base::DifferenceTest), which under these covariances
/// is a sum of squared normal variables with the eigenvalues of its covariance as weights. (The method of mrcal's projection-diff,
/// mrcal.secretsauce.net/differencing.html, which fits rays in place of pixels and weights by uncertainty.)
///
/// Errors: kUsage for options; kBadInput for images of different sizes; kNoUniqueSolution where the models have fewer than 10
/// cells in common or no motion fits.
base::Result<base::ProjectionDifference> projection_difference(const base::Camera& a, const base::Camera& b,
                                                               const ProjectionDifferenceOptions& options = {});

}  // namespace crosstie::math
