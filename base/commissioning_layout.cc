#include "base/commissioning_layout.h"

namespace crosstie::base {

Result<CommissioningLayout> commissioning_layout(const Commissioning& commissioning) {
  CommissioningLayout at;
  at.left_size = parameter_count(commissioning.head.left.model());
  at.right_size = parameter_count(commissioning.head.right.model());
  at.right = at.left_size;
  at.rig = at.right + at.right_size;
  at.frame = at.rig + 6;
  at.frame_size = commissioning.frame.cov.rows();
  at.cross = at.frame + at.frame_size;
  at.markers = at.cross + 7;
  const Eigen::Index size = at.markers + 3 * static_cast<Eigen::Index>(commissioning.markers.size());
  const Eigen::MatrixXd& covariance = commissioning.covariance;
  constexpr Eigen::Index kLeastOfFrame = 9;  // the pose, two directions, the scale
  if (at.frame_size < kLeastOfFrame || covariance.rows() != size || covariance.cols() != size || !covariance.allFinite()) {
    return fail(ErrorCode::kBadInput,
                "the commissioning's covariance does not belong to its head, axis and markers: run commission again");
  }
  return at;
}

}  // namespace crosstie::base
