#pragma once

#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "edge/detail/camera_miss.h"
#include "edge/detail/rim_fusion.h"
#include "edge/hole_edge.h"

namespace crosstie::edge::detail {

/// The stations' poses, six parameters each, then those of their heads: where they stand and their covariance.
struct SharedParameters {
  std::map<const base::Head*, Eigen::Index> heads;  ///< first parameter of each
  Eigen::MatrixXd cov;
};

/// kInternal where what the stations share is of another size.
base::Result<SharedParameters> shared_parameters(std::span<const StationView> stations, const SharedKnowledge& shared);

/// What the shared parameters do to the points and their normals, as EdgeCurve has it; these tilt towards FusedCell::across and along across x normal.
struct SharedParts {
  Eigen::MatrixXd points_mm;
  Eigen::MatrixXd tilts_rad;
};

/// Where the head was adjusted, the cells follow.
SharedParts shared_parts(std::vector<FusedCell>& cells, std::span<const StationView> stations,
                         const SharedParameters& parameters, const Eigen::VectorXd& head_change);

/// Where the cameras miss each other, both are wrong by as much as one another for all that is known: what they see together is turned about their
/// base by half of the miss, in all stations of a head the same way.
void add_misses(const std::vector<FusedCell>& cells, std::span<const StationView> stations,
                const std::vector<CameraMiss>& misses, SharedParts& shared);

}  // namespace crosstie::edge::detail
