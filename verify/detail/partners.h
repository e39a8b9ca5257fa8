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
  std::vector<int> reference_ids;
  std::vector<int> only_measured;
  std::vector<int> only_reference;

  /// Those of `pairs` that are used.
  [[nodiscard]] std::vector<math::AlignmentPair> used_pairs() const;
};

/// Measured points without an id of their own take no part here; add_by_position() finds their partners.
base::Result<Partners> match_by_id(const base::PointList& measured, const base::PointList& reference,
                                   std::span<const int> exclude_ids);

/// Appends the measured points without an id of their own, each with the nearest point of the reference that has no partner yet,
/// within `gate_mm` after the fit (reference = scale * pose * measured); the nearest pairs first, so that each point of either
/// list has one partner at most. None of them is used in the fit. Returns the ids of those that found no partner.
std::vector<int> add_by_position(const base::PointList& measured, const base::PointList& reference,
                                 const base::Pose& reference_from_measured, double scale, double gate_mm, Partners& partners);

}  // namespace crosstie::verify::detail
