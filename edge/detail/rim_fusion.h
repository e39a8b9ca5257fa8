#pragma once

#include <vector>

#include <Eigen/Core>

#include "edge/detail/rim_candidates.h"
#include "edge/detail/rim_line.h"
#include "edge/hole_edge.h"

namespace crosstie::edge::detail {

/// What one camera of one station says of a cell.
struct Voice {
  int station = 0;
  int camera = 0;
  int pixels = 0;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_in_rig_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double off_mm = 0.0;    ///< from the smooth line, away from the material
  double sigma_mm = 0.0;  ///< of it
  double surface_sigma_mm = 0.0;
  Eigen::Vector2d tilt_sigma_rad = Eigen::Vector2d::Zero();  ///< of the normal's tilts, across the rim and along it
  double slant = 0.0;  ///< by how much a point moves across the rim when its surface moves by one along the normal
  double band_mm = 0.0;

  [[nodiscard]] double weight() const { return 1.0 / (sigma_mm * sigma_mm); }
};

/// One point of the rim in the making.
struct FusedCell {
  std::vector<Voice> voices;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d across = Eigen::Vector3d::Zero();
  double sigma_mm = 0.0;
  double surface_sigma_mm = 0.0;
  Eigen::Vector2d tilt_sigma_rad = Eigen::Vector2d::Zero();
  double slant = 0.0;
  double off_mm = 0.0;
  double disagreement = 1.0;

  /// Of one of its voices in the cell's means.
  [[nodiscard]] double share(const Voice& voice) const;
};

/// The members of a cell by station and camera.
std::vector<Voice> voices_of(const std::vector<const RimCandidate*>& members, const RimLine& line);

/// Cameras and stations together; those that contradict the others and the neighbours go.
FusedCell fuse(std::vector<Voice> voices, const RimLine& line, double max_w, HoleEdge::Counts& counts);

/// Scatter of the cells about the line through their neighbours, themselves left out, over what their sigmas say.
double roughness(const std::vector<FusedCell>& cells, double reach_mm, std::vector<double>& off_mm);

}  // namespace crosstie::edge::detail
