#pragma once

#include "base/network.h"
#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"

namespace crosstie::bundle::detail {

/// Parts of diagnose() (outcome.h); each appends to result.warnings.

/// high_correlation, weak_parameter, not_significant, poor_coverage, planar_points, planar_not_rolled, not_rolled: of the
/// lenses that were estimated.
void about_lenses(const Survey& survey, const State& state, base::AdjustedNetwork& result);

/// one_side, small_in_image, id_twice: how the points were photographed.
void about_views(const Survey& survey, base::AdjustedNetwork& result);

/// The points' own box: their middle and, as columns, the directions of least to greatest spread with the spreads (standard
/// deviations).
struct Spread {
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d directions = Eigen::Matrix3d::Identity();
  Eigen::Vector3d along_mm = Eigen::Vector3d::Zero();
};
[[nodiscard]] Spread spread_of(const base::AdjustedNetwork& network);

}  // namespace crosstie::bundle::detail
