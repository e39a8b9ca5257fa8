#pragma once

#include <optional>
#include <span>
#include <vector>

#include "math/rigid_alignment.h"

namespace crosstie::verify::detail {

/// A fit that up to almost half of the pairs cannot pull away.
struct RobustFit {
  std::vector<double> distance_mm;  ///< of each pair after the fit
  double median_mm = 0.0;           ///< of distance_mm
  base::Pose a_from_b;
  double scale = 1.0;
};

/// Least median of squares over triples (all of them for small sets, else a fixed seeded sample), then least squares over the
/// pairs within 4 medians. Nothing where no triple determines a fit. Needs at least 4 pairs.
std::optional<RobustFit> robust_fit(std::span<const math::AlignmentPair> pairs, bool with_scale);

/// Negates z of the b side: pairs that fit afterwards and not before are mirror images of each other.
std::vector<math::AlignmentPair> mirrored(std::span<const math::AlignmentPair> pairs);

}  // namespace crosstie::verify::detail
