#pragma once

#include "base/detail/result_json.h"
#include "base/machine.h"

namespace crosstie::base::detail {

/// The figures that every adjustment has.
template <typename Adjusted>
void add_figures(const Adjusted& adjusted, Json& json) {
  json["sigma0"] = adjusted.sigma0;
  json["sigma0_px"] = adjusted.sigma0_px;
  json["rms_px"] = adjusted.rms_px;
  json["observations"] = adjusted.observations;
  json["unknowns"] = adjusted.unknowns;
  json["redundancy"] = adjusted.redundancy;
  json["iterations"] = adjusted.iterations;
  json["least_eigenvalue"] = adjusted.least_eigenvalue;
  json["weakest"] = adjusted.weakest;
}

/// The head's pose at a reading, with its covariances.
inline Json head_pose_json(const HeadPose& pose) {
  return {{"axis_mm", pose.axis_mm},
          {"machine_from_rig", matrix_json(pose.machine_from_rig)},
          {"cov", upper_triangle_json(pose.cov)},
          {"stop_cov", upper_triangle_json(pose.stop_cov)}};
}

}  // namespace crosstie::base::detail
