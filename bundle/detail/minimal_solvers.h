#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"

namespace crosstie::bundle::detail {

/// The poses from which three points are seen in three directions (unit length, in camera): up to four, OpenGV's version of
/// Kneip, Scaramuzza & Siegwart, CVPR 2011. None for points on a line.
std::vector<base::Pose> three_point_poses(const std::array<Eigen::Vector3d, 3>& directions,
                                          const std::array<Eigen::Vector3d, 3>& points_in_network);

/// A line of sight of a camera on a head.
struct HeadSight {
  base::Pose rig_from_camera;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of unit length, in camera
};

/// The poses world_from_rig from which a head of several cameras sees three points along three sights: the generalised absolute pose
/// problem, up to eight, OpenGV's version of Kneip, Furgale & Siegwart, ICRA 2013. For sights of one camera only: three_point_poses.
std::vector<base::Pose> head_poses(const std::array<HeadSight, 3>& sights, const std::array<Eigen::Vector3d, 3>& points);

/// The essential matrices E with a' E b = 0 for five pairs of directions: up to ten, OpenGV's version of Nister, PAMI 26(6),
/// 2004.
std::vector<Eigen::Matrix3d> five_point_essentials(const std::array<Eigen::Vector3d, 5>& directions_a,
                                                   const std::array<Eigen::Vector3d, 5>& directions_b);

/// The four motions a_from_b (translation of unit length) of an essential matrix with a' E b = 0.
std::vector<base::Pose> motions_of_essential(const Eigen::Matrix3d& essential);

/// The homography H with a ~ H b for four or more pairs of directions, least squares in the algebraic error.
Eigen::Matrix3d homography(const std::vector<Eigen::Vector3d>& directions_a, const std::vector<Eigen::Vector3d>& directions_b);

/// The motions a_from_b that a homography between two views of a plane allows, in units of the plane's distance from b: two, or
/// none for a pure rotation (Ma, Soatto, Kosecka & Sastry, An Invitation to 3-D Vision, theorem 5.19). `directions_b` are used
/// to keep the plane in front of the camera.
std::vector<base::Pose> motions_of_homography(const Eigen::Matrix3d& homography,
                                              const std::vector<Eigen::Vector3d>& directions_a,
                                              const std::vector<Eigen::Vector3d>& directions_b);

}  // namespace crosstie::bundle::detail
