#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "edge/hole_edge.h"

namespace crosstie::edge::detail {

/// An edge pixel in space.
struct RimCandidate {
  int station = 0;
  int camera = 0;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< in the frame; rays and normals as well
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< of the surface on its material side, towards the camera
  Eigen::Vector3d out = Eigen::Vector3d::Zero();       ///< in that surface across the edge, away from the material; unit
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();       ///< unit, from the camera
  /// Of the point per radian: along its surface when its camera alone turns about the base, and with it when all does that was seen.
  Eigen::Vector3d slide_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_mm = Eigen::Vector3d::Zero();
  double sigma_mm = 0.0;                                     ///< across the edge, of the image
  double surface_sigma_mm = 0.0;                             ///< of the surface, along its normal
  Eigen::Vector2d tilt_sigma_rad = Eigen::Vector2d::Zero();  ///< of the normal's tilts, across the edge and along it
  double band_mm = 0.0;
  double piece_mm = 0.0;                              ///< length of edge behind it
  double surface_piece_mm = 0.0;                      ///< length of edge behind the surface's sigma
  double depths_mm = 0.0;                             ///< length of edge before which the depths lie
  Eigen::Vector2d left_px = Eigen::Vector2d::Zero();  ///< where the left camera sees it
  double angle_rad = 0.0;                             ///< there about the middle of the region
  Eigen::Vector3d point_in_rig_mm = Eigen::Vector3d::Zero();
};

/// The edge pixels of one station as points; `passed` are points of edges that are no material edges, to tell why there are gaps.
struct StationCandidates {
  std::vector<RimCandidate> rim;
  std::vector<RimCandidate> shadows;
};
StationCandidates candidates_of(const StationView& view, int station, const HoleEdgeOptions& options, HoleEdge::Counts& counts);

/// The face about the hole: a height over a plane, with curvatures.
struct Face {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< columns: two in the plane, then the normal towards the cameras
  Eigen::Matrix<double, 6, 1> height = Eigen::Matrix<double, 6, 1>::Zero();

  [[nodiscard]] Eigen::Vector3d local(const Eigen::Vector3d& point_mm) const {
    return axes.transpose() * (point_mm - origin_mm);
  }
  [[nodiscard]] double off_mm(const Eigen::Vector3d& point_mm) const;
  [[nodiscard]] Eigen::Vector3d normal_at(const Eigen::Vector3d& point_mm) const;
};

/// The nearest surface on which many of the candidates lie.
base::Result<Face> find_face(const std::vector<RimCandidate>& candidates, double max_off_mm);

}  // namespace crosstie::edge::detail
