#pragma once

#include <cstdint>
#include <vector>

#include "base/machine.h"
#include "base/observation.h"
#include "base/result.h"
#include "base/scan_summary.h"
#include "scan/cloud.h"

namespace crosstie::scan {

/// Markers on a scanned wall. Sizes are in radii of a marker's dot.
struct MarkerOptions {
  /// What lies nearer than this to the middle of a marker belongs to its plate, or the magnet that holds it. Default: with the white
  /// border of ring10.
  double mask_radii = 3.6;
  double mask_margin_px = 2.0;  ///< beyond that: pixels that see both
  /// The wall beneath a marker is fitted to the points between the mask and this.
  double surface_radii = 7.0;
  double thickness_mm = 0.0;   ///< from the wall to the plane of the dots
  double dot_radius_mm = 0.0;  ///< 0: as large as the ellipses show it

  [[nodiscard]] base::Result<> validate() const;
};

/// Takes the points on markers, as either camera saw them, out of the cloud and of its depths; returns how many. A marker is what was
/// read as one, even if its id is doubtful or not in use, and every other dot of its size in the same image (between half and twice
/// the median of the read ones): a plate that something hides.
std::int64_t mask_markers(ScanCloud& scan, const base::Head& head, const base::ImageObservations& left,
                          const base::ImageObservations& right, const MarkerOptions& options);

/// The markers that both cameras read, by id, from their images alone, with the wall beneath each of them from the cloud.
///
/// The centre is the point with the least squared distance from both observations under their covariances. Where the wall beneath is
/// known, its normal tells how the ellipses' centres lie beside the images of the circle's centre, and the observations are reduced
/// to these. The wall: a second-order surface through the cloud's points round the marker by weighted least squares without those
/// that lie on another surface. Call mask_markers() before. `filter_radius_px` is the cloud's.
/// Errors: options; kBadInput where the cameras do not look side by side.
base::Result<std::vector<base::ScannedMarker>> marker_points(const ScanCloud& scan, const base::Head& head,
                                                             const base::ImageObservations& left,
                                                             const base::ImageObservations& right, int filter_radius_px,
                                                             const MarkerOptions& options);

}  // namespace crosstie::scan
