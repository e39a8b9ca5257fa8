#pragma once

#include <vector>

#include <Eigen/Core>

namespace crosstie::bench {

/// What a peer found: the motion of the second cloud onto the first.
struct PeerAlignment {
  Eigen::Matrix4d first_from_second = Eigen::Matrix4d::Identity();
  bool converged = false;
};

using Points = std::vector<Eigen::Vector3d>;

/// PCL's generalised ICP: normals' covariances, search and alignment, 20 neighbours, its defaults but for tolerances that fit mm.
PeerAlignment pcl_gicp(const Points& first, const Points& second, const Eigen::Matrix4d& start, double reach_mm);
/// Open3D's point-to-plane ICP: normals of 20 neighbours, search and alignment, its defaults.
PeerAlignment open3d_point_to_plane(const Points& first, const Points& second, const Eigen::Matrix4d& start, double reach_mm);

}  // namespace crosstie::bench
