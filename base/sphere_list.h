#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads the balls of a cross: a list of points (point_list.h) with their sigmas or covariances, and the column `diameter_mm` where
/// the diameters are known. Sorted by id. Beside the Errors of a list of points: sigmas that are missing, a diameter that is not
/// positive, with file and line.
Result<std::vector<ReferenceSphere>> read_reference_spheres(const std::filesystem::path& path);

/// Reads the centres of balls as a machine found them: a list of points with their sigmas or covariances; a column `axes` names the
/// coordinates that count for the frame ("xyz", "z", "yz"), all where there is none.
Result<std::vector<ProbedSphere>> read_probed_spheres(const std::filesystem::path& path);

/// The touches of one ball: where the centre of the stylus tip was.
struct ProbeHits {
  int id = 0;
  std::vector<Eigen::Vector3d> tips_mm;  ///< in machine, in the order of their lines
};

/// Reads `sphere,x_mm,y_mm,z_mm`, a line for each touch; sorted by sphere.
Result<std::vector<ProbeHits>> read_probe_hits(const std::filesystem::path& path);

}  // namespace crosstie::base
