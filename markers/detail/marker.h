#pragma once

#include <optional>
#include <vector>

#include "base/observation.h"
#include "markers/detail/candidates.h"
#include "markers/detail/dot_fit.h"
#include "markers/detail/ring.h"
#include "markers/detect.h"

namespace crosstie::markers::detail {

/// A candidate that turned out to be a dot.
struct Marker {
  DotFit dot;
  RingReading ring;
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();
  int id = base::kNoId;
  base::ObservationStatus status = base::ObservationStatus::kUncoded;
};

/// Fits the dot and reads what stands around it; nothing where it is not a dot.
std::optional<Marker> measure_marker(const Sampler& image, const Candidate& candidate, const MarkerFamily& family,
                                     const DetectOptions& options);

/// Keeps one of several findings of the same dot, and removes the "dots" that are segments of a marker that was read.
void remove_duplicates(std::vector<Marker>& markers, const MarkerFamily& family);

/// cov_px2 = covariance for the pixels' noise times the power of the edges' deviations from ellipses. A single dot tells its
/// power with 6 degrees of freedom only, so it is taken together with the median of the image.
void scale_covariances(std::vector<Marker>& markers);

}  // namespace crosstie::markers::detail
