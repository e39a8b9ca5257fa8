#pragma once

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"
#include "base/projection_map.h"
#include "base/result.h"

namespace crosstie::math {

struct ProjectionSigmasOptions {
  /// [mm] Distance of the points along the ray. Default: 0, at infinity.
  double distance_mm = 0.0;
  /// Cells in a row of the grid. Default: 40.
  int columns = 40;
  /// [px] Of a coordinate of an image point, for triangulated points: its share is added. Default: 0, the calibration's share alone.
  double sigma_px = 0.0;

  [[nodiscard]] base::Result<> validate() const;
};

/// Standard deviation of a camera's projection over its image.
///
/// What a lens's covariance says of a pixel depends on the frame in which the point stands still. The camera's own frame is no answer:
/// it turns with the principal point, and every pixel would share the large sigma of that. So the point stands still
/// - where `covariance` belongs to the lens parameters alone: in the frame that, by least squares over the calibrated cells, moves
///   with the projections (the implied motion of projection_difference(): rotation, and translation for a finite distance);
/// - where it has six more rows and columns: in the frame of the boards, of whose mean motion as seen from the camera,
///   [rotation rad, translation mm] on the left of camera_from_boards, they are the covariance (mrcal's "mean frames" method,
///   mrcal.secretsauce.net/uncertainty.html):  dq = dq/dlens dlens + dq/dp (w x p + v).
///
/// Errors: kUsage for options and for a covariance of another size; kNoUniqueSolution where the camera has no calibrated cell.
base::Result<base::ProjectionSigmas> projection_sigmas(const base::Camera& camera, const Eigen::MatrixXd& covariance,
                                                       const ProjectionSigmasOptions& options = {});

/// Standard deviation of a point that a pair of cameras sees, at the pixel and distance as the left one sees it.
///
/// `covariance` is joint: parameters of the left lens, of the right one, right_from_left; and, where it has six more rows and
/// columns, the mean motion of the boards in the left camera's frame. Without them the point stands in the left camera's frame, with
/// them it is meant against the boards, as a machine frame would be that is found through the same cameras.
/// The point is that of least squares of its two projections.
///
/// Errors as above, and kUsage for a point at infinity.
base::Result<base::TriangulationSigmas> triangulation_sigmas(const base::Camera& left, const base::Camera& right,
                                                             const base::Pose& right_from_left,
                                                             const Eigen::MatrixXd& covariance,
                                                             const ProjectionSigmasOptions& options);

/// d p / d pixel across the ray: the right inverse of d pixel / d p.
Eigen::Matrix<double, 3, 2> across(const Eigen::Matrix<double, 2, 3>& by_point);

}  // namespace crosstie::math
