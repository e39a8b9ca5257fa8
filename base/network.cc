#include "base/network.h"

#include <cmath>

namespace crosstie::base {

double AdjustedRig::baseline_mm() const { return mounts.size() < 2 ? 0.0 : mounts[1].rig_from_camera.translation_mm.norm(); }

double AdjustedRig::baseline_sigma_mm() const {
  if (mounts.size() < 2) return 0.0;
  const Eigen::Vector3d along = mounts[1].rig_from_camera.translation_mm.normalized();
  return std::sqrt(std::max(0.0, along.dot(position_covariance(mounts[1].rig_from_camera, mounts[1].cov) * along)));
}

}  // namespace crosstie::base
