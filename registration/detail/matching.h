#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/progress.h"
#include "base/result.h"
#include "registration/surface.h"

namespace crosstie::registration::detail {

/// Two pieces of surface that are taken as one, in the common frame.
struct Match {
  int a = 0;  ///< index of the piece of the first surface
  int b = 0;
  Eigen::Vector3d place_mm = Eigen::Vector3d::Zero();  ///< between both
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< along the sum of both normals
  double distance_mm = 0.0;                            ///< first minus second, along the normal
  /// Of the distance, so that all matches together count no piece twice: where m pieces of the first have the same partner, the
  /// partner's variance counts m times. Its normal's error acts over half of the distance along the surface.
  double sigma_mm = 0.0;
  double scatter_mm = 0.0;  ///< sigma of this distance alone, which its residual scatters by
};

struct MatchGates {
  double reach_mm = 0.0;   ///< largest distance along the surface
  double height_mm = 0.0;  ///< largest distance along the normal
  double max_normal_rad = 0.35;
};

/// Partners of the first surface's pieces on the second: the nearest one, within the gates; pieces at the second's border are partners only
/// of what lies straight above them.
base::Result<std::vector<Match>> find_matches(const Surface& first, const Surface& second, const base::Pose& frame_from_first,
                                              const base::Pose& frame_from_second, const MatchGates& gates, int threads);

/// The same pairs at other poses.
void update_matches(const Surface& first, const Surface& second, const base::Pose& frame_from_first,
                    const base::Pose& frame_from_second, std::vector<Match>& matches);

/// Whether the boxes round both surfaces meet, from a sample of the first's pieces.
bool may_overlap(const Surface& first, const Surface& second, const base::Pose& second_from_first, double margin_mm);

}  // namespace crosstie::registration::detail
