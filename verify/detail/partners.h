#pragma once

#include <span>
#include <vector>

#include "base/point_list.h"
#include "base/result.h"
#include "math/rigid_alignment.h"

namespace crosstie::verify::detail {

/// The common points of two lists, sorted by id: in `pairs` a is the reference and b the measurement.
struct Partners {
  std::vector<int> ids;
  std::vector<math::AlignmentPair> pairs;
  std::vector<std::size_t> measured_index;  ///< into the measured list
  std::vector<bool> has_covariance;         ///< whether either side gives one
  std::vector<bool> used;
  std::vector<int> only_measured;
  std::vector<int> only_reference;

  /// Those of `pairs` that are used.
  [[nodiscard]] std::vector<math::AlignmentPair> used_pairs() const;
};

base::Result<Partners> match_by_id(const base::PointList& measured, const base::PointList& reference,
                                   std::span<const int> exclude_ids);

}  // namespace crosstie::verify::detail
