#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "base/cloud.h"
#include "base/machine.h"
#include "base/progress.h"
#include "base/result.h"
#include "base/stitching.h"

namespace crosstie::registration {

struct MergeOptions {
  double cell_mm = 2.0;  ///< all points of a cube with this edge become one
  /// Sigma of the points of clouds without the field sigma_mm, along their ray. Nothing: such clouds are an Error.
  std::optional<double> sigma_mm = {};

  /// kUsage where a value is out of its range.
  [[nodiscard]] base::Result<> validate() const;
};

/// One cloud of all stations, station by station: only the cells are in memory (about 150 bytes each), never two stations' points.
///
/// A cell's point is the mean of its points, weighted by their noise. Its covariance is that of the mean, with the noise as the overlaps
/// show it (surface_factor, independent_share), plus what the whole station shares: its pose's and the head's covariance, which no
/// averaging reduces. Where more than one station saw a cell, the difference of their means along the normal over its sigma is kept.
class CloudMerger {
 public:
  /// `stitching` must outlive it. `head`: the one that the clouds were computed with; where stitch has adjusted it, the points follow.
  CloudMerger(const base::Stitching& stitching, const MergeOptions& options, std::optional<base::Head> head = {});
  CloudMerger(CloudMerger&&) noexcept;
  CloudMerger(const CloudMerger&) = delete;
  CloudMerger& operator=(const CloudMerger&) = delete;
  CloudMerger& operator=(CloudMerger&&) = delete;
  ~CloudMerger();

  /// Adds the cloud of a station, in its rig. Each station once, in any order; the order decides about rounding alone.
  base::Result<> add(int station, const base::Cloud& cloud);

  /// The merged cloud in the stitching's frame, with normals, cov_mm2 (all of it) and the fields noise_mm (of the mean, along the normal),
  /// shared_mm (largest axis of what its station shares), points, stations (numbers that went into it), difference (of two stations, in
  /// sigmas; 0 where only one saw the cell). Call it once.
  base::Cloud finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace crosstie::registration
