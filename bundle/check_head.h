#pragma once

#include <optional>
#include <vector>

#include "base/machine.h"
#include "base/observation.h"
#include "base/result.h"

namespace crosstie::bundle {

/// One new pair of photographs, and what is known from the commissioning.
struct CheckInput {
  const base::Commissioning* commissioning =
      nullptr;           ///< its head, frame, machine_from_cross, markers, covariance and labels are used
  double axis_mm = 0.0;  ///< the reading where the pair was taken
  base::ImageObservations left;
  base::ImageObservations right;
  std::vector<base::ProbedSphere> probed_again = {};  ///< the cross's spheres, probed now: tells the head from the cross
  std::optional<double> temperature_c = {};           ///< of the head now
};

struct CheckOptions {
  double significance = 1e-3;        ///< probability that an unmoved rig is accused; the same of the head-or-cross test
  double temperature_limit_c = 5.0;  ///< of the head against its calibration, beyond which there is a warning

  [[nodiscard]] base::Result<> validate() const;
};

/// Whether head and frame still hold. The image points of one pair are compared with what the commissioning predicts, with the joint
/// covariance of both; changes of the rig (right_from_left, 6) and of the head against the cross (6) are estimated together and each
/// is tested with the other one free; of the rig all six together and each as if it alone had moved.
///
/// Without the cross in view (fewer than 6 image points of its markers) the markers that both cameras see, wherever they are, test the rig by
/// their distances from the epipolar curves: pitch and roll well, yaw hardly, the baseline's length not at all; HeadCheck::rig_seen says what,
/// cross_markers is 0, and nothing is said of the head's place.
///
/// One pair cannot tell whether the head moved on its carriage or the cross on the machine: probed_again does.
///
/// Errors: kBadInput for a reading outside of the travel (MachineFrame::at); kNoUniqueSolution where neither 6 image points of markers of the
/// cross nor 8 markers common to both cameras are seen.
base::Result<base::HeadCheck> check_head(const CheckInput& input, const CheckOptions& options = {});

}  // namespace crosstie::bundle
