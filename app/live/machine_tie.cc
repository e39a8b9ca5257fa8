#include "app/live/machine_tie.h"

#include "base/commissioning_layout.h"

namespace crosstie::app {

using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;

Result<live::MachineTie> machine_tie(const base::Commissioning& commissioning, double axis_mm) {
  const auto at = base::commissioning_layout(commissioning);
  if (!at) return tl::unexpected(at.error());
  const auto pose = commissioning.frame.at(axis_mm);
  if (!pose) return tl::unexpected(pose.error());
  live::MachineTie tie{.machine_from_rig = pose->machine_from_rig, .cov = pose->cov + pose->stop_cov};
  // Derivatives of head, machine_from_rig and the markers in machine by the commissioning's parameters.
  const Index head = at->head_size();
  const Index markers = head + 6;
  MatrixXd by_known =
      MatrixXd::Zero(markers + 3 * static_cast<Index>(commissioning.markers.size()), commissioning.covariance.rows());
  by_known.topLeftCorner(head, head).setIdentity();
  by_known.block(head, at->frame, 6, at->frame_size) = commissioning.frame.jacobian(axis_mm);
  const Eigen::Matrix3d cross_turn = commissioning.machine_from_cross.rotation.toRotationMatrix();
  for (std::size_t i = 0; i < commissioning.markers.size(); ++i) {
    const base::CommissionedMarker& marker = commissioning.markers[i];
    const Eigen::Vector3d p_in_machine = commissioning.machine_from_cross * marker.xyz_mm;
    tie.known.push_back({.id = marker.id, .xyz_mm = p_in_machine});
    auto rows = by_known.middleRows<3>(markers + 3 * static_cast<Index>(i));
    rows.middleCols<3>(at->cross) = -base::skew(p_in_machine);
    rows.middleCols<3>(at->cross + 3).setIdentity();
    rows.middleCols<3>(at->markers + 3 * static_cast<Index>(i)) = cross_turn;
  }
  tie.joint_cov = by_known * commissioning.covariance * by_known.transpose();
  tie.joint_cov.block<6, 6>(head, head) += pose->stop_cov;
  for (std::size_t i = 0; i < tie.known.size(); ++i) {
    const Index row = markers + 3 * static_cast<Index>(i);
    tie.known[i].cov_mm2 = tie.joint_cov.block<3, 3>(row, row);
  }
  return tie;
}

}  // namespace crosstie::app
