#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/observation.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::bundle {

/// What a commissioning starts from.
struct CommissionInput {
  base::Head head;
  base::Cross cross;
  std::vector<base::ProbedSphere> probed;
  std::vector<base::Station> stations;
  std::vector<base::ImageObservations> images;  ///< those that the stations name
  double reading_sigma_mm = 0.005;              ///< of a reading of the axis
  /// Further photographs taken at a station without moving, each with the name of the station's own one by the same camera: they share
  /// its pose and its reading, and their noise averages.
  struct Repeated {
    std::string of;
    std::string image;
  };
  std::vector<Repeated> repeated = {};
};

/// Part of space in which the head measures, in the rig's frame: where the frame's share of the uncertainty is reported.
struct WorkingVolume {
  Eigen::Vector3d from_mm = Eigen::Vector3d(-300.0, -500.0, 1200.0);
  Eigen::Vector3d to_mm = Eigen::Vector3d(1100.0, 500.0, 1400.0);
};

struct CommissionOptions {
  /// Level of the test of each error motion and of the encoder's scale, two-sided: how often one that is not there is found.
  double significance = 1e-3;
  /// Level at which an image point or a sphere is rejected, before it is divided by their number (Bonferroni).
  double rejection_significance = 0.01;
  /// Multiply the image points' sigmas by one factor that makes their residuals true (variance component); false: as stated.
  bool estimate_image_sigma = true;
  /// Scatter of the carriage at its stops round the model. Nothing: 0, unless the stations contradict the full model at the level
  /// 1e-2; then what they show (residual maximum likelihood, one value for coordinates and one for angles).
  std::optional<double> stop_sigma_mm = {};
  std::optional<double> stop_sigma_rad = {};
  /// Point in machine, with the axis at reading 0, whose path direction, scale and straightness describe (LinearAxis): the functional point
  /// of ISO 230-1. Nothing: the middle of what the head saw of the cross, on its carriage. Far from there an angle moves all that the head
  /// sees, and photographs cannot tell it from straightness: a roll may then be taken for a pitch.
  std::optional<Eigen::Vector3d> pivot_mm = {};
  /// Error motions that are not significant take part all the same, near 0 (ErrorMotion::in_frame); false: they are taken to be none, and
  /// one just below the level biases head and lenses by several of their sigmas.
  bool small_motions = true;
  /// Distance of an image point from its prediction by the start values beyond which its id is not believed.
  double tolerance_px = 5.0;
  std::optional<WorkingVolume> volume = {};  ///< nothing: the box round the cross as the stations saw it

  /// kUsage where a value is out of its range.
  [[nodiscard]] base::Result<> validate() const;
};

/// Joins the scanning head to the machine: one adjustment of lenses and rig (prior: their calibration), the cross (prior: its list,
/// grown to the machine's temperature), the head's pose, the X axis with those error motions that the data carry, and the cross's
/// place, from image points, axis readings and probed spheres. docs/formulation.md, "The head in the machine's frame".
///
/// Start values need no guess: generalised absolute pose of the two-camera head at each station with RANSAC (OpenGV), weighted
/// rigid fit of the spheres, robust line through the stations. Image points and spheres that contradict all others are rejected with
/// reasons, a station whose reading does not fit its pose too.
///
/// Errors: kNoUniqueSolution for stations that do not span the axis (one, or equal readings), for fewer than three spheres or spheres
/// on a line, for masks that leave the frame free, for stations that do not see the cross; kBadInput for spheres that are swapped or
/// of another diameter than the list's, for readings in inches, for swapped left and right photographs, for the cross's covariance.
base::Result<base::Commissioning> commission(const CommissionInput& input, const CommissionOptions& options = {},
                                             const base::Progress& progress = {});

}  // namespace crosstie::bundle
