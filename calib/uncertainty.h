#pragma once

#include <Eigen/Core>

#include "base/calibration.h"
#include "base/projection_map.h"
#include "base/result.h"
#include "math/projection_sigmas.h"

namespace crosstie::calib {

/// Projection uncertainty of a calibrated camera over its image, from the joint covariance of the whole calibration: lens, rig and
/// the boards' poses. The point stands still in the frame of the boards (math::projection_sigmas): how well pixels agree with
/// what the calibration saw, whatever the camera's frame did. `camera` is an index into Calibration::cameras.
/// Errors: as math::projection_sigmas; kBadInput for a calibration without covariance.
base::Result<base::ProjectionSigmas> projection_sigmas(const base::Calibration& calibration, int camera,
                                                       const math::ProjectionSigmasOptions& options);

/// The frame in which a triangulated point is meant.
enum class PointFrame {
  kRig,     ///< the left camera's: everything, the left lens's own wobble against its frame included
  kBoards,  ///< of the boards: what is left after a machine frame has been found through the same cameras
};

/// Uncertainty of a point that both cameras see, over the left image: math::triangulation_sigmas with the joint covariance of left
/// lens, right lens and rig. Errors: as there; kBadInput without a rig.
base::Result<base::TriangulationSigmas> triangulation_sigmas(const base::Calibration& calibration, PointFrame frame,
                                                             const math::ProjectionSigmasOptions& options);

/// Joint covariance of a camera's lens parameters and of the mean motion of the boards that it saw, as math::projection_sigmas takes
/// it; empty where the calibration has none.
Eigen::MatrixXd lens_and_boards_covariance(const base::Calibration& calibration, int camera);

}  // namespace crosstie::calib
